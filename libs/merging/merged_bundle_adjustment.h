#pragma once

#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/chi_square.h"
#include "libs/merging/merged_map.h"
#include "libs/optim/bundle_adjustment.h"

namespace mapmend {

struct MergedBundleOptions {
  BundleOptions bundle;
  // Points that take part in the joint solution: for each keyframe at least this many of its longest tracks. The others
  // follow, each fitted to the solved poses. 0: all points take part.
  int points_per_keyframe = 250;
  // Readout times of the flights' rolling shutters are unknowns too. The result is taken only if it lowers the cost by
  // this fraction and so much (chance: 2), and each is a readout time that there could be; else the map stays as it is.
  bool find_readouts = false;
  double min_gain = 0.01;  // 0.002 to 0.006 where all rows were read at once, 0.015 to 0.2 elsewhere
  double min_drop = 20;
  double min_readout = 0.002, max_readout = 0.1;    // seconds, either way: a camera may be mounted upside down
  double outlier_squared_error = kChiSquare2Dof99;  // sigma^2; observations beyond it are removed after the adjustment

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("bundle", bundle);
    v("points_per_keyframe", points_per_keyframe, Range(0, 1e6), "points; 0: all");
    v("find_readouts", find_readouts);
    v("min_gain", min_gain, Range(0, 1), "of the cost");
    v("min_drop", min_drop, AtLeast(0), "of the cost");
    v("min_readout", min_readout, AtLeast(0), "s");
    v("max_readout", max_readout, AtLeast(0), "s");
    v("outlier_squared_error", outlier_squared_error, MoreThan(0), "sigma^2");
  }
};

struct PositionPrior;

struct MergedBundleSummary {
  bool success = false;
  int num_points = 0, num_observations = 0;  // in the joint solution
  int num_iterations = 0;
  int num_removed = 0;  // outlier observations
  double initial_cost = 0, final_cost = 0;
  std::string reason;  // of finding readout times or not
};

// Bundle adjustment of a merged map: all poses but keyframe 0, all points. With a window (keyframes), the poses of its
// keyframes and the points they see; everything else stays. Then outliers are removed, points left with fewer than two
// observations are culled, and each keyframe's scale is measured anew.
//   positions  of keyframes; null, or empty: none. Where there are some, keyframe 0 is free as well
MergedBundleSummary AdjustMergedMap(const MergedBundleOptions& options, MergedMap* map,
                                    const std::vector<int>* window = nullptr,
                                    const std::vector<PositionPrior>* positions = nullptr);

// Fits every point to the poses as they are (Gauss-Newton, Huber); a point that would end behind a camera stays.
void RefinePoints(MergedMap* map, const std::vector<char>* only = nullptr);

// Sets each keyframe's scale to the median ratio of its points' depths, merged over raw.
void MeasureScales(MergedMap* map);

}  // namespace mapmend
