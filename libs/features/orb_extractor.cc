#include "libs/features/orb_extractor.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "libs/base/options.h"
#include "libs/features/corner.h"
#include "libs/features/oriented_brief.h"
#include "libs/features/patch_kernels.h"

namespace mapmend {
namespace {

// Keypoints keep this distance from the edge: every pixel that the descriptor compares exists. The blur reaches
// further, for which levels are padded by reflection.
constexpr int kBorder = PatchKernels::kBlurRadius;
constexpr int kPadding = 4;
constexpr int kTensorRadius = 4;  // pixels that the strength of a corner needs
constexpr size_t kAhead = 6;      // corners whose pixels are on their way while one is measured

// One level of the pyramid, a view into the workspace: pixel (x, y) is data[y * stride + x]; kPadding pixels around the
// level exist and, to the right, as many as the kernels may read.
struct Level {
  int width = 0, height = 0;
  ptrdiff_t stride = 0;
  uint8_t* data = nullptr;

  cv::Mat Image() const { return cv::Mat(height, width, CV_8UC1, data, static_cast<size_t>(stride)); }
  const uint8_t* At(const Corner& c) const { return data + c.y * stride + c.x; }
  // Fetches the square around a corner into the cache: one corner after the other is looked at all over the level.
  void Prefetch(const Corner& c, int radius) const {
    const uint8_t *left = At(c) - radius * stride - radius, *right = left + 2 * radius;
    for (int y = -radius; y <= radius; ++y, left += stride, right += stride) {
      __builtin_prefetch(left);
      __builtin_prefetch(right);
    }
  }
};

// Memory of one extraction, kept for the next.
struct Workspace {
  std::vector<uint8_t> pixels;
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

// Scores of three rows at a time, in which maxima are sought.
struct ScoreRows {
  explicit ScoreRows(int width)
      : row_bytes(static_cast<size_t>(width + 2 * PatchKernels::kReadAhead)),
        bytes(3 * row_bytes, 0),
        maxima(static_cast<size_t>(width)) {}
  size_t row_bytes;
  std::vector<uint8_t> bytes;
  std::vector<int16_t> maxima;  // of one row
};

// Calls found(x, y, score) for the local maxima of the FAST scores above threshold with begin_x <= x < end_x and
// begin_y <= y < end_y, and row_done(y) after each row. Pixels around the area count too when maxima are sought, so
// that these do not depend on where the area ends.
template <typename Found, typename RowDone>
void FindMaxima(const Level& level, const PatchKernels& kernels, int threshold, int begin_x, int end_x, int begin_y,
                int end_y, ScoreRows* rows, const Found& found, const RowDone& row_done) {
  uint8_t *above = rows->bytes.data(), *row = above + rows->row_bytes, *below = row + rows->row_bytes;
  const auto score = [&](int y, uint8_t* scores) {
    return kernels.fast_row(level.data + y * level.stride, level.stride, begin_x - 1, end_x + 1,
                            static_cast<uint8_t>(threshold), scores);
  };
  score(begin_y - 1, above);
  bool any_row = score(begin_y, row);
  for (int y = begin_y; y < end_y; ++y) {
    const bool any_below = score(y + 1, below);
    if (any_row) {
      const int count = kernels.maxima_row(above, row, below, begin_x, end_x, rows->maxima.data());
      for (int i = 0; i < count; ++i) found(rows->maxima[i], y, row[rows->maxima[i]]);
    }
    row_done(y);
    uint8_t* free = above;
    above = row;
    row = below;
    below = free;
    any_row = any_below;
  }
}

// Corners of the level: local maxima of the FAST score above the threshold of their cell. That is the higher one where
// the cell has a corner above it: only other cells are searched again.
std::vector<Corner> DetectCorners(const Level& level, const OrbOptions& options, const PatchKernels& kernels) {
  const int begin = kBorder, end_x = level.width - kBorder, end_y = level.height - kBorder, cell = options.cell_size;
  std::vector<Corner> corners;
  const auto add = [&](int x, int y, uint8_t score) {
    corners.push_back({static_cast<int16_t>(x), static_cast<int16_t>(y), score});
  };
  const int num_cells = (end_x - begin + cell - 1) / cell;
  std::vector<uint8_t> is_strong(static_cast<size_t>(num_cells), 0);  // cells of the present row of cells
  size_t first_in_row_of_cells = 0;
  ScoreRows strong_rows(level.width), weak_rows(level.width);
  const auto search_weak_cells = [&](int begin_y, int last_y) {
    for (size_t i = first_in_row_of_cells; i < corners.size(); ++i) is_strong[(corners[i].x - begin) / cell] = 1;
    for (int i = 0; i < num_cells; ++i) {
      if (is_strong[i]) continue;
      const int first = i;
      while (i + 1 < num_cells && !is_strong[i + 1]) ++i;
      FindMaxima(level, kernels, options.min_fast_threshold, begin + first * cell,
                 std::min(begin + (i + 1) * cell, end_x), begin_y, last_y + 1, &weak_rows, add, [](int) {});
    }
    std::fill(is_strong.begin(), is_strong.end(), uint8_t{0});
    first_in_row_of_cells = corners.size();
  };
  FindMaxima(level, kernels, options.fast_threshold, begin, end_x, begin, end_y, &strong_rows, add, [&](int y) {
    const int row_in_cell = (y - begin) % cell;
    if (row_in_cell == cell - 1 || y == end_y - 1) search_weak_cells(y - row_in_cell, y);
  });
  return corners;
}

// Corners that lie where the mask is 0 make room for others.
void RemoveMasked(const cv::Mat& mask8, const Level& level, std::vector<Corner>* corners) {
  const double sx = mask8.cols / static_cast<double>(level.width), sy = mask8.rows / static_cast<double>(level.height);
  std::erase_if(*corners, [&](const Corner& c) {
    const int x = std::min(static_cast<int>((c.x + 0.5) * sx), mask8.cols - 1);
    const int y = std::min(static_cast<int>((c.y + 0.5) * sy), mask8.rows - 1);
    return mask8.at<uint8_t>(y, x) == 0;
  });
}

// Harris and Stephens, Alvey 1988: det - 0.04 trace^2.
float HarrisStrength(const PatchKernels::Tensor& t) {
  const float xx = static_cast<float>(t.xx), xy = static_cast<float>(t.xy), yy = static_cast<float>(t.yy);
  return xx * yy - xy * xy - 0.04f * (xx + yy) * (xx + yy);
}

}  // namespace

std::string OrbOptions::Check() const { return CheckOptions(*this); }

std::string OrbOptions::Conflict() const {
  return min_fast_threshold <= fast_threshold ? "" : "min_fast_threshold must not be more than fast_threshold";
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
  if (const std::string error = options_.Check(); !error.empty()) throw std::invalid_argument("ORB: " + error);
}

OrbExtractor::~OrbExtractor() = default;

RawFeatures OrbExtractor::Extract(const cv::Mat& grey8, const cv::Mat* mask8) const {
  RawFeatures features;
  if (grey8.empty()) return features;
  if (grey8.type() != CV_8UC1) throw std::invalid_argument("ORB extraction needs an 8-bit grey image");
  if (mask8 != nullptr && (mask8->type() != CV_8UC1 || mask8->size() != grey8.size()))
    throw std::invalid_argument("ORB extraction: the mask is not 8-bit grey of the image's size");
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
    corners[i] = DetectCorners(levels[i], options_, kernels);
    if (mask8 != nullptr) RemoveMasked(*mask8, levels[i], &corners[i]);
    available[i] = static_cast<int>(corners[i].size());
    weights[i] = i == 0 ? 1.0 : weights[i - 1] / options_.scale_factor;
  }
  const std::vector<int> wanted = ShareOut(weights, available, options_.num_features);

  alignas(64) uint8_t patch[(2 * PatchKernels::kBlurRadius + 1) * PatchKernels::kBlurStride];
  for (size_t i = 0; i < num_levels; ++i) {
    if (wanted[i] == 0) continue;
    const Level& level = levels[i];
    std::vector<Corner> candidates = Preselect(std::move(corners[i]), level.width, level.height, wanted[i]);
    for (size_t j = 0; j < candidates.size(); ++j) {
      if (j + kAhead < candidates.size()) level.Prefetch(candidates[j + kAhead], kTensorRadius);
      Corner& c = candidates[j];
      c.strength = HarrisStrength(kernels.tensor(level.At(c), level.stride));
    }
    // Resizing maps pixel areas onto each other: the sizes of the levels are rounded, so use their true ratio.
    const Eigen::Vector2f half(0.5f, 0.5f), scale(static_cast<float>(grey8.cols) / static_cast<float>(level.width),
                                                  static_cast<float>(grey8.rows) / static_cast<float>(level.height));
    const std::vector<Corner> selected = SelectSpread(candidates, wanted[i], options_.corners_per_node);
    for (size_t j = 0; j < selected.size(); ++j) {
      if (j + 1 < selected.size()) level.Prefetch(selected[j + 1], PatchKernels::kBlurRadius);
      const Corner& c = selected[j];
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
