#include "libs/features/wide_features.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <tuple>

#if defined(__SSSE3__)
#include <tmmintrin.h>
#endif

#include "libs/base/options.h"

namespace mapmend {
namespace {

constexpr double kUnit = 256;

uint8_t QuantiseSize(float size) {
  const double exponent = WideKeypoint::kSizesPerOctave * std::log2(std::max(1.0F, size));
  return static_cast<uint8_t>(std::clamp(std::lround(exponent), 0L, 255L));
}

uint8_t QuantiseAngle(float degrees) {
  return static_cast<uint8_t>(std::lround(static_cast<double>(degrees) * 256 / 360) & 255);
}

WideDescriptor RootSift(const float* sift) {
  double sum = 0;
  for (int i = 0; i < 128; ++i) sum += sift[i];
  WideDescriptor root;
  for (int i = 0; i < 128; ++i) {
    const double value = sum > 0 ? kUnit * std::sqrt(sift[i] / sum) : 0;
    root[i] = static_cast<uint8_t>(std::min(127L, std::lround(value)));
  }
  return root;
}

// Strongest first; ties by place, so that the order does not depend on how OpenCV found them.
std::vector<size_t> Ranked(const std::vector<cv::KeyPoint>& keypoints) {
  std::vector<size_t> order(keypoints.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const auto key = [&](size_t i) {
    const cv::KeyPoint& k = keypoints[i];
    return std::tuple(-k.response, k.pt.y, k.pt.x, k.size, k.angle);
  };
  std::sort(order.begin(), order.end(), [&](size_t l, size_t r) { return key(l) < key(r); });
  return order;
}

}  // namespace

double WideKeypoint::SizePx() const { return std::exp2(size / kSizesPerOctave); }

std::string WideExtractionOptions::Check() const { return CheckOptions(*this); }

WideFeatures ExtractWideFeatures(const cv::Mat& grey, const cv::Mat* mask, const WideExtractionOptions& options) {
  cv::Mat image = grey, image_mask;
  if (mask != nullptr) image_mask = *mask;
  float scale = 1;
  while (static_cast<double>(image.total()) > 1e6 * options.max_megapixels) {
    scale *= 2;
    const cv::Size half(image.cols / 2, image.rows / 2);
    cv::Mat smaller;
    cv::resize(image, smaller, half, 0, 0, cv::INTER_AREA);
    image = smaller;
    if (!image_mask.empty()) {
      cv::Mat smaller_mask;
      cv::resize(image_mask, smaller_mask, half, 0, 0, cv::INTER_NEAREST);
      image_mask = smaller_mask;
    }
  }
  // OpenCV chooses the strongest before it looks at the mask: then all must come, for enough to be left.
  const int wanted = image_mask.empty() ? options.max_features : 0;
  const cv::Ptr<cv::SIFT> sift = cv::SIFT::create(wanted, 3, options.contrast_threshold);
  std::vector<cv::KeyPoint> found;
  cv::Mat sifts;
  sift->detectAndCompute(image, image_mask, found, sifts);
  WideFeatures features;
  for (const size_t i : Ranked(found)) {
    if (features.Size() >= options.max_features) break;
    const cv::KeyPoint& k = found[i];
    // The middle of a pixel is at whole numbers, in the small image as in the large one.
    const Eigen::Vector2f pixel(scale * (k.pt.x + 0.5F) - 0.5F, scale * (k.pt.y + 0.5F) - 0.5F);
    features.keypoints.push_back({pixel, QuantiseSize(scale * k.size), QuantiseAngle(k.angle)});
    features.descriptors.push_back(RootSift(sifts.ptr<float>(static_cast<int>(i))));
  }
  return features;
}

int WideDot(const WideDescriptor& a, const WideDescriptor& b) {
#if defined(__SSSE3__)
  const __m128i ones = _mm_set1_epi16(1);
  __m128i sum = _mm_setzero_si128();
  for (size_t i = 0; i < a.size(); i += 16) {
    const __m128i x = _mm_loadu_si128(reinterpret_cast<const __m128i*>(a.data() + i));
    const __m128i y = _mm_loadu_si128(reinterpret_cast<const __m128i*>(b.data() + i));
    sum = _mm_add_epi32(sum, _mm_madd_epi16(_mm_maddubs_epi16(x, y), ones));
  }
  sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0x4E));
  sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0xB1));
  return _mm_cvtsi128_si32(sum);
#else
  int sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
#endif
}

std::vector<WideMatch> MatchWide(const WideFeatures& a, const WideFeatures& b, const WideMatchingOptions& options) {
  std::vector<int> norm_b(b.Size()), best_a(b.Size(), -1), best_of_b(b.Size(), std::numeric_limits<int>::max());
  for (int j = 0; j < b.Size(); ++j) norm_b[j] = WideDot(b.descriptors[j], b.descriptors[j]);
  std::vector<WideMatch> nearest;
  const double max_ratio = options.ratio * options.ratio;
  const double same_place = options.same_place * options.same_place;
  for (int i = 0; i < a.Size(); ++i) {
    const WideDescriptor& descriptor = a.descriptors[i];
    const int norm_a = WideDot(descriptor, descriptor);
    int first = std::numeric_limits<int>::max(), second = first, at = -1;
    for (int j = 0; j < b.Size(); ++j) {
      const int distance = norm_a + norm_b[j] - 2 * WideDot(descriptor, b.descriptors[j]);
      if (distance < best_of_b[j]) {
        best_of_b[j] = distance;
        best_a[j] = i;
      }
      if (distance >= second) continue;
      const bool is_same = at >= 0 && (b.keypoints[j].pixel - b.keypoints[at].pixel).squaredNorm() < same_place;
      if (distance < first) {
        if (!is_same) second = first;
        first = distance;
        at = j;
      } else if (!is_same) {
        second = distance;
      }
    }
    if (at >= 0 && first <= max_ratio * second) nearest.push_back({i, at, first});
  }
  std::erase_if(nearest, [&](const WideMatch& m) { return best_a[m.b] != m.a; });
  return nearest;
}

}  // namespace mapmend
