#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "libs/base/range.h"
#include "libs/features/features.h"

// Descriptor matching between two images. All functions are deterministic; ties go to the lower index.
namespace mapmend {

struct Match {
  int a = -1, b = -1;  // feature indices
  int distance = 256;  // Hamming
};

struct MatchOptions {
  int max_distance = 64;          // bits; true matches of ORB rarely differ by more
  double ratio = 0.8;             // best / second best distance must be below (Lowe, IJCV 2004)
  bool mutual = true;             // b's best must be a too
  bool check_orientation = true;  // keep only matches whose rotation agrees with the dominant one

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_distance", max_distance, Range(0, 256), "bits");
    v("ratio", ratio, Range(0, 1));
    v("mutual", mutual);
    v("check_orientation", check_orientation);
  }
};

// Every feature of a against every feature of b: needs no motion model, costs |a||b| comparisons (2000 x 2000: 10 ms).
// mask_a, mask_b: indices to use; empty = all.
std::vector<Match> MatchBruteForce(const Features& a, const Features& b, const MatchOptions& options,
                                   const std::vector<int>& mask_a = {}, const std::vector<int>& mask_b = {});

// Only features of like vocabulary node are compared (BoW-guided, Galvez-Lopez and Tardos 2012): about 50 times
// cheaper, finds fewer. nodes as from Vocabulary::Transform.
std::vector<Match> MatchByNodes(const Features& a, const std::vector<int32_t>& nodes_a, const Features& b,
                                const std::vector<int32_t>& nodes_b, const MatchOptions& options,
                                const std::vector<int>& mask_a = {}, const std::vector<int>& mask_b = {});

// Removes matches whose change of keypoint angle is not among the three most frequent (30 bins of 12 degrees).
void FilterByOrientation(const Features& a, const Features& b, std::vector<Match>* matches);

// Features sorted into square cells, for searches around a predicted pixel.
class FeatureGrid {
 public:
  FeatureGrid() = default;
  FeatureGrid(const std::vector<Keypoint>& keypoints, int width, int height, int cell_size = 24);

  // Calls visit(index) for every feature in the cells that touch the square of half-width radius around pixel; the
  // caller checks the exact distance.
  template <typename Visit>
  void VisitNear(const Eigen::Vector2f& pixel, float radius, Visit visit) const;
  // The same for the cells within margin (pixels) of the segment from p0 to p1, and some beside them.
  template <typename Visit>
  void VisitAlong(const Eigen::Vector2f& p0, const Eigen::Vector2f& p1, float margin, Visit visit) const;

 private:
  int Cell(float v, int count) const;
  int cell_size_ = 0, columns_ = 0, rows_ = 0;
  std::vector<int> first_;    // per cell, begin in indices_; one more at the end
  std::vector<int> indices_;  // features by cell, ascending within a cell
};

struct GuidedSearch {
  float radius = 15;  // pixels
  int min_octave = 0, max_octave = 127;
  int max_distance = 64;
  double ratio = 0.9;  // against the second best of the same or a neighbouring octave; 1: off
};

// Best match for a descriptor around a predicted pixel, or a = -1 ... b = -1 if none passes. used[i] != 0: skip feature
// i.
Match FindNear(const Features& features, const FeatureGrid& grid, const Eigen::Vector2f& pixel,
               const Descriptor& descriptor, const GuidedSearch& search, const std::vector<uint8_t>& used);

template <typename Visit>
void FeatureGrid::VisitNear(const Eigen::Vector2f& pixel, float radius, Visit visit) const {
  if (columns_ == 0) return;
  const int x0 = Cell(pixel.x() - radius, columns_), x1 = Cell(pixel.x() + radius, columns_);
  const int y0 = Cell(pixel.y() - radius, rows_), y1 = Cell(pixel.y() + radius, rows_);
  for (int y = y0; y <= y1; ++y) {
    for (int k = first_[y * columns_ + x0]; k < first_[y * columns_ + x1 + 1]; ++k) visit(indices_[k]);
  }
}

template <typename Visit>
void FeatureGrid::VisitAlong(const Eigen::Vector2f& p0, const Eigen::Vector2f& p1, float margin, Visit visit) const {
  if (columns_ == 0) return;
  const int y0 = Cell(std::min(p0.y(), p1.y()) - margin, rows_), y1 = Cell(std::max(p0.y(), p1.y()) + margin, rows_);
  const Eigen::Vector2f d = p1 - p0;
  for (int y = y0; y <= y1; ++y) {
    // The part of the segment that passes this row of cells; the outermost rows reach to infinity.
    float begin = 0, end = 1;
    if (std::abs(d.y()) > 1e-3f) {
      const float size = static_cast<float>(cell_size_);
      const float top = y == 0 ? -1e9f : static_cast<float>(y) * size - margin;
      const float bottom = y == rows_ - 1 ? 1e9f : static_cast<float>(y + 1) * size + margin;
      const float at_top = (top - p0.y()) / d.y(), at_bottom = (bottom - p0.y()) / d.y();
      begin = std::max(begin, std::min(at_top, at_bottom));
      end = std::min(end, std::max(at_top, at_bottom));
      if (begin > end) continue;
    }
    const float x_begin = p0.x() + begin * d.x(), x_end = p0.x() + end * d.x();
    const int x0 = Cell(std::min(x_begin, x_end) - margin, columns_),
              x1 = Cell(std::max(x_begin, x_end) + margin, columns_);
    for (int k = first_[y * columns_ + x0]; k < first_[y * columns_ + x1 + 1]; ++k) visit(indices_[k]);
  }
}

}  // namespace mapmend
