#include "libs/capture/steady_range.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <vector>

namespace mapmend {
namespace {

constexpr double kLeftOut = 0.005;    // share of the pixels beyond either end of the range
constexpr double kAdaptation = 0.05;  // per image; a tenth of a change is left after 45
constexpr double kMinOverlap = 0.25;  // of the smaller range; with less the scene is a new one, and is followed at once
constexpr size_t kMaxSamples = 200000;

}  // namespace

std::optional<SteadyRange::Range> SteadyRange::Measure(const cv::Mat& image) {
  // What lies at the very ends of the type says "no data" or "too much", not how warm the scene is.
  const bool is_16_bit = image.depth() == CV_16U;
  std::vector<float> samples, all;
  const size_t values = static_cast<size_t>(image.cols) * static_cast<size_t>(image.channels());
  const size_t step = 1 + values * static_cast<size_t>(image.rows) / kMaxSamples;
  cv::Mat row;
  size_t at = 0;
  for (int y = 0; y < image.rows; ++y) {
    image.row(y).reshape(1).convertTo(row, CV_32F);
    const float* value = row.ptr<float>();
    for (; at < values; at += step) {
      if (!std::isfinite(value[at])) continue;
      all.push_back(value[at]);
      if (!is_16_bit || (value[at] > 0 && value[at] < 65535)) samples.push_back(value[at]);
    }
    at -= values;
  }
  if (samples.size() < all.size() / 4) samples = all;
  if (samples.empty()) return std::nullopt;
  const auto percentile = [&](double share) {
    const auto nth = samples.begin() + std::lround(share * static_cast<double>(samples.size() - 1));
    std::nth_element(samples.begin(), nth, samples.end());
    return static_cast<double>(*nth);
  };
  return Range{percentile(kLeftOut), percentile(1 - kLeftOut)};
}

bool SteadyRange::Overlap(const Range& a, const Range& b) {
  const double common = std::min(a.high, b.high) - std::max(a.low, b.low);
  return common >= kMinOverlap * std::min(a.high - a.low, b.high - b.low);
}

cv::Mat SteadyRange::To8Bit(const cv::Mat& image) {
  if (image.depth() == CV_8U) return image;
  if (const auto now = Measure(image)) {
    if (!range_ || !Overlap(*range_, *now)) {
      range_ = now;
    } else {
      range_->low += kAdaptation * (now->low - range_->low);
      range_->high += kAdaptation * (now->high - range_->high);
    }
  }
  cv::Mat result;
  const double extent = range_ ? range_->high - range_->low : 0;
  const double scale = extent > 0 ? 255.0 / extent : 1.0;
  image.convertTo(result, CV_8U, scale, range_ ? -range_->low * scale : 0);
  return result;
}

}  // namespace mapmend
