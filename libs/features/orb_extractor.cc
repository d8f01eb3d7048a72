#include "libs/features/orb_extractor.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "libs/features/corner.h"
#include "libs/features/oriented_brief.h"

namespace mapmend {
namespace {

// Keypoints keep this distance from the edge, so that every pixel of the patch exists.
constexpr int kBorder = OrientedBrief::kPatchRadius;
constexpr int kFastRadius = 3;

void CheckRange(const char* name, double value, double low, double high) {
  if (!(value >= low && value <= high)) {
    throw std::invalid_argument(std::string("ORB option ") + name + " must lie in [" + std::to_string(low) + ", " +
                                std::to_string(high) + "]");
  }
}

std::vector<cv::Mat> BuildPyramid(const cv::Mat& image, const OrbOptions& options) {
  std::vector<cv::Mat> levels = {image};
  double scale = 1;
  for (int i = 1; i < options.num_levels; ++i) {
    scale *= options.scale_factor;
    const cv::Size size(cvRound(image.cols / scale), cvRound(image.rows / scale));
    if (std::min(size.width, size.height) <= 2 * kBorder) break;
    levels.emplace_back();
    cv::resize(levels[i - 1], levels[i], size, 0, 0, cv::INTER_LINEAR);
  }
  return levels;
}

// Corners of image(area) at the given threshold after non-maximum suppression, in coordinates of image.
void DetectIn(const cv::Mat& image, const cv::Rect& area, int threshold, std::vector<Corner>* corners) {
  std::vector<cv::KeyPoint> found;
  const cv::Rect read(area.x - kFastRadius, area.y - kFastRadius, area.width + 2 * kFastRadius,
                      area.height + 2 * kFastRadius);
  cv::FAST(image(read), found, threshold, true);
  for (const cv::KeyPoint& k : found) {
    corners->push_back({static_cast<int16_t>(k.pt.x + read.x), static_cast<int16_t>(k.pt.y + read.y),
                        static_cast<uint8_t>(k.response)});
  }
}

std::vector<Corner> DetectCorners(const cv::Mat& image, const OrbOptions& options) {
  std::vector<Corner> corners;
  const cv::Rect area(kBorder, kBorder, image.cols - 2 * kBorder, image.rows - 2 * kBorder);
  if (area.width <= 0 || area.height <= 0) return corners;
  DetectIn(image, area, options.fast_threshold, &corners);

  const int cell = options.cell_size;
  const int columns = (area.width + cell - 1) / cell, rows = (area.height + cell - 1) / cell;
  std::vector<bool> has_corner(static_cast<size_t>(columns) * rows, false);
  for (const Corner& c : corners) has_corner[(c.y - kBorder) / cell * columns + (c.x - kBorder) / cell] = true;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      if (has_corner[row * columns + column]) continue;
      const cv::Rect box(kBorder + column * cell, kBorder + row * cell, cell, cell);
      DetectIn(image, box & area, options.min_fast_threshold, &corners);
    }
  }
  return corners;
}

}  // namespace

void OrbOptions::Check() const {
  CheckRange("num_features", num_features, 1, 100000);
  CheckRange("scale_factor", scale_factor, 1.01, 4);
  CheckRange("num_levels", num_levels, 1, 32);
  CheckRange("fast_threshold", fast_threshold, 1, 254);
  CheckRange("min_fast_threshold", min_fast_threshold, 1, fast_threshold);
  CheckRange("cell_size", cell_size, 8, 1024);
}

struct OrbExtractor::Impl {
  OrientedBrief brief;
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

  const std::vector<cv::Mat> levels = BuildPyramid(grey8, options_);
  const int num_levels = static_cast<int>(levels.size());
  std::vector<std::vector<Corner>> corners(num_levels);
  std::vector<double> weights(num_levels);
  std::vector<int> available(num_levels);
  for (int i = 0; i < num_levels; ++i) {
    corners[i] = DetectCorners(levels[i], options_);
    available[i] = static_cast<int>(corners[i].size());
    weights[i] = i == 0 ? 1.0 : weights[i - 1] / options_.scale_factor;
  }
  const std::vector<int> wanted = ShareOut(weights, available, options_.num_features);

  for (int i = 0; i < num_levels; ++i) {
    const std::vector<Corner> selected = SelectSpread(corners[i], wanted[i]);
    if (selected.empty()) continue;
    const cv::Mat& level = levels[i];
    cv::Mat blurred;
    cv::GaussianBlur(level, blurred, cv::Size(7, 7), 2, 2, cv::BORDER_REFLECT_101 | cv::BORDER_ISOLATED);
    // Resizing maps pixel areas onto each other: the sizes of the levels are rounded, so use their true ratio.
    const float scale_x = static_cast<float>(grey8.cols) / static_cast<float>(level.cols);
    const float scale_y = static_cast<float>(grey8.rows) / static_cast<float>(level.rows);
    for (const Corner& c : selected) {
      Keypoint keypoint;
      keypoint.pixel = {(c.x + 0.5f) * scale_x - 0.5f, (c.y + 0.5f) * scale_y - 0.5f};
      keypoint.octave = static_cast<int8_t>(i);
      keypoint.angle = impl_->brief.Angle(level.ptr(c.y) + c.x, static_cast<int>(level.step));
      features.keypoints.push_back(keypoint);
      features.descriptors.push_back(
          impl_->brief.Describe(blurred.ptr(c.y) + c.x, static_cast<int>(blurred.step), keypoint.angle));
    }
  }
  return features;
}

}  // namespace mapmend
