#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libs/base/range.h"
#include "procs/viewer_export/ground.h"

namespace mapmend {

struct CoverageOptions {
  int min_images = 3;             // that should see a place
  int cells_per_footprint = 24;   // of the grid, along the shorter side of a usual footprint
  double smallest_region = 0.02;  // of a usual footprint's area

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_images", min_images, Range(1, 100), "keyframes");
    v("cells_per_footprint", cells_per_footprint, Range(4, 200));
    v("smallest_region", smallest_region, AtLeast(0), "footprints");
  }
};

// A connected piece of ground that too few images see.
struct CoverageRegion {
  int fewest_images = 0;  // anywhere in it; 0: it has a hole
  double area = 0, area_unseen = 0;
  // Ground plane. The first ring runs counter-clockwise around it, the others around what is not part of it.
  std::vector<std::vector<Eigen::Vector2d>> rings;
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
};

// How many keyframes see each cell of the ground.
struct Coverage {
  double cell = 0;                                   // side
  Eigen::Vector2d corner = Eigen::Vector2d::Zero();  // of the first cell, least x and y
  int width = 0, height = 0;                         // cells
  std::vector<uint16_t> counts;                      // row by row, along x first
  double area_seen = 0, area_few = 0;  // by any image; by some, but fewer than min_images, at the edges too
  double area_enough = 0;
  std::vector<CoverageRegion> regions;  // that lie inside, not at the edge; largest first

  int Count(int x, int y) const {
    return counts[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
  }
};

// The outline of the surveyed area is what the footprints cover, with bays and holes narrower than a footprint taken
// in. The outer half of a footprint's width of it is the edge, which naturally few images see.
Coverage MeasureCoverage(const std::vector<Footprint>& footprints, const CoverageOptions& options);

}  // namespace mapmend
