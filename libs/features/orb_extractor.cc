#include "libs/features/orb_extractor.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "libs/features/corner.h"
#include "libs/features/oriented_brief.h"
#include "libs/features/patch_kernels.h"

namespace mapmend {
namespace {

// Keypoints keep this distance from the edge: every pixel that the descriptor compares exists. The blur reaches
// further, for which levels are padded by reflection.
constexpr int kBorder = PatchKernels::kBlurRadius;
constexpr int kPadding = 4;

void CheckRange(const char* name, double value, double low, double high) {
  if (!(value >= low && value <= high)) {
    throw std::invalid_argument(std::string("ORB option ") + name + " must lie in [" + std::to_string(low) + ", " +
                                std::to_string(high) + "]");
  }
}

// One level of the pyramid, a view into the workspace: pixel (x, y) is data[y * stride + x]; kPadding pixels around the
// level exist and, to the right, as many as the kernels may read.
struct Level {
  int width = 0, height = 0;
  ptrdiff_t stride = 0;
  uint8_t* data = nullptr;

  cv::Mat Image() const { return cv::Mat(height, width, CV_8UC1, data, static_cast<size_t>(stride)); }
  const uint8_t* At(const Corner& c) const { return data + c.y * stride + c.x; }
};

// Memory of one extraction, kept for the next.
struct Workspace {
  std::vector<uint8_t> pixels, scores;
  std::vector<Level> levels;
};

void Pad(const Level& level) {
  for (int y = 0; y < level.height; ++y) {
    uint8_t* row = level.data + y * level.stride;
    for (int i = 1; i <= kPadding; ++i) {
      row[-i] = row[i];
      row[level.width - 1 + i] = row[level.width - 1 - i];
    }
  }
  const size_t bytes = static_cast<size_t>(level.width + 2 * kPadding);
  uint8_t *top = level.data - kPadding, *bottom = top + (level.height - 1) * level.stride;
  for (int i = 1; i <= kPadding; ++i) {
    std::memcpy(top - i * level.stride, top + i * level.stride, bytes);
    std::memcpy(bottom + i * level.stride, bottom - i * level.stride, bytes);
  }
}

void BuildPyramid(const cv::Mat& image, const OrbOptions& options, Workspace* workspace) {
  std::vector<Level>& levels = workspace->levels;
  levels.clear();
  double scale = 1;
  size_t size = 0;
  for (int i = 0; i < options.num_levels; ++i, scale *= options.scale_factor) {
    Level level;
    level.width = cvRound(image.cols / scale);
    level.height = cvRound(image.rows / scale);
    if (std::min(level.width, level.height) <= 2 * kBorder) break;
    level.stride = (level.width + 2 * kPadding + PatchKernels::kReadAhead + 15) / 16 * 16;
    size += static_cast<size_t>(level.stride) * (level.height + 2 * kPadding);
    levels.push_back(level);
  }
  workspace->pixels.resize(std::max(workspace->pixels.size(), size + PatchKernels::kReadAhead));
  uint8_t* at = workspace->pixels.data();
  for (size_t i = 0; i < levels.size(); ++i) {
    Level& level = levels[i];
    level.data = at + kPadding * level.stride + kPadding;
    at += level.stride * (level.height + 2 * kPadding);
    cv::Mat target = level.Image();
    if (i == 0) {
      image.copyTo(target);
    } else {
      cv::resize(levels[i - 1].Image(), target, target.size(), 0, 0, cv::INTER_LINEAR);
    }
    Pad(level);
  }
}

// Corners of the level: local maxima of the FAST score above the threshold of their cell.
std::vector<Corner> DetectCorners(const Level& level, const OrbOptions& options, const PatchKernels& kernels,
                                  std::vector<uint8_t>* buffer) {
  const int begin = kBorder, end_x = level.width - kBorder, end_y = level.height - kBorder;
  const size_t row_bytes = static_cast<size_t>(level.width + 2 * PatchKernels::kReadAhead);
  buffer->assign(4 * row_bytes, 0);
  uint8_t *above = buffer->data(), *row = above + row_bytes, *below = row + row_bytes, *mask = below + row_bytes;
  bool any_row = false;  // in row
  std::vector<Corner> corners;
  // Rows beyond the area count too when maxima are sought, so that they do not depend on where the area ends.
  for (int y = begin - 1; y <= end_y; ++y) {
    const bool any_below = kernels.fast_row(level.data + (y + 1) * level.stride, level.stride, begin - 1, end_x + 1,
                                            static_cast<uint8_t>(options.min_fast_threshold), below);
    if (y >= begin && y < end_y && any_row) {
      kernels.maxima_row(above, row, below, begin, end_x, mask);
      for (int x = begin; x < end_x; x += 8) {
        uint64_t eight;
        std::memcpy(&eight, mask + x, sizeof(eight));
        if (eight == 0) continue;
        for (int i = x; i < std::min(x + 8, end_x); ++i) {
          if (mask[i]) corners.push_back({static_cast<int16_t>(i), static_cast<int16_t>(y), row[i]});
        }
      }
    }
    std::swap(above, row);
    std::swap(row, below);
    any_row = any_below;
  }

  const int cell = options.cell_size, columns = level.width / cell + 1, rows = level.height / cell + 1;
  std::vector<uint8_t> is_strong(static_cast<size_t>(columns) * rows, 0);
  const auto cell_of = [&](const Corner& c) { return (c.y - kBorder) / cell * columns + (c.x - kBorder) / cell; };
  for (const Corner& c : corners) is_strong[cell_of(c)] |= c.score > options.fast_threshold;
  std::erase_if(corners, [&](const Corner& c) { return c.score <= options.fast_threshold && is_strong[cell_of(c)]; });
  return corners;
}

// Harris and Stephens, Alvey 1988: det - 0.04 trace^2.
float HarrisStrength(const PatchKernels::Tensor& t) {
  const float xx = static_cast<float>(t.xx), xy = static_cast<float>(t.xy), yy = static_cast<float>(t.yy);
  return xx * yy - xy * xy - 0.04f * (xx + yy) * (xx + yy);
}

}  // namespace

void OrbOptions::Check() const {
  CheckRange("num_features", num_features, 1, 100000);
  CheckRange("scale_factor", scale_factor, 1.01, 4);
  CheckRange("num_levels", num_levels, 1, 32);
  CheckRange("fast_threshold", fast_threshold, 1, 254);
  CheckRange("min_fast_threshold", min_fast_threshold, 1, fast_threshold);
  CheckRange("cell_size", cell_size, 8, 1024);
  CheckRange("corners_per_node", corners_per_node, 1, 100000);
}

struct OrbExtractor::Impl {
  const PatchKernels& kernels = PatchKernels::Get();
  OrientedBrief brief;
  std::mutex mutex;
  std::vector<std::unique_ptr<Workspace>> idle;  // as many as extractions have run at a time

  std::unique_ptr<Workspace> Take() {
    const std::lock_guard lock(mutex);
    if (idle.empty()) return std::make_unique<Workspace>();
    std::unique_ptr<Workspace> workspace = std::move(idle.back());
    idle.pop_back();
    return workspace;
  }
  void GiveBack(std::unique_ptr<Workspace> workspace) {
    const std::lock_guard lock(mutex);
    idle.push_back(std::move(workspace));
  }
};

OrbExtractor::OrbExtractor(const OrbOptions& options) : options_(options), impl_(std::make_unique<Impl>()) {
  options_.Check();
}

OrbExtractor::~OrbExtractor() = default;

RawFeatures OrbExtractor::Extract(const cv::Mat& grey8) const {
  RawFeatures features;
  if (grey8.empty()) return features;
  if (grey8.type() != CV_8UC1) throw std::invalid_argument("ORB extraction needs an 8-bit grey image");
  if (std::max(grey8.cols, grey8.rows) > 32767) throw std::invalid_argument("ORB extraction: image side over 32767");

  std::unique_ptr<Workspace> workspace = impl_->Take();
  BuildPyramid(grey8, options_, workspace.get());
  const std::vector<Level>& levels = workspace->levels;
  const PatchKernels& kernels = impl_->kernels;
  const size_t num_levels = levels.size();
  std::vector<std::vector<Corner>> corners(num_levels);
  std::vector<double> weights(num_levels);
  std::vector<int> available(num_levels);
  for (size_t i = 0; i < num_levels; ++i) {
    corners[i] = DetectCorners(levels[i], options_, kernels, &workspace->scores);
    available[i] = static_cast<int>(corners[i].size());
    weights[i] = i == 0 ? 1.0 : weights[i - 1] / options_.scale_factor;
  }
  const std::vector<int> wanted = ShareOut(weights, available, options_.num_features);

  alignas(64) uint8_t patch[(2 * PatchKernels::kBlurRadius + 1) * PatchKernels::kBlurStride];
  for (size_t i = 0; i < num_levels; ++i) {
    if (wanted[i] == 0) continue;
    const Level& level = levels[i];
    std::vector<Corner> candidates = Preselect(std::move(corners[i]), level.width, level.height, wanted[i]);
    for (Corner& c : candidates) c.strength = HarrisStrength(kernels.tensor(level.At(c), level.stride));
    // Resizing maps pixel areas onto each other: the sizes of the levels are rounded, so use their true ratio.
    const Eigen::Vector2f half(0.5f, 0.5f), scale(static_cast<float>(grey8.cols) / static_cast<float>(level.width),
                                                  static_cast<float>(grey8.rows) / static_cast<float>(level.height));
    for (const Corner& c : SelectSpread(candidates, wanted[i], options_.corners_per_node)) {
      const uint8_t* center = level.At(c);
      int m10 = 0, m01 = 0;
      kernels.moments(center, level.stride, &m10, &m01);
      kernels.blur_patch(center, level.stride, patch);
      Keypoint keypoint;
      // The pixel of the level as it is: refining it by Foerstner's method made epipolar errors 3 to 17 % larger.
      keypoint.pixel = (Eigen::Vector2f(c.x, c.y) + half).cwiseProduct(scale) - half;
      keypoint.octave = static_cast<int8_t>(i);
      keypoint.angle = PortableAtan2(static_cast<float>(m01), static_cast<float>(m10));
      features.keypoints.push_back(keypoint);
      features.descriptors.push_back(impl_->brief.Describe(patch, keypoint.angle));
    }
  }
  impl_->GiveBack(std::move(workspace));
  return features;
}

}  // namespace mapmend
