#pragma once

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
  double outlier_squared_error = kChiSquare2Dof99;  // sigma^2; observations beyond it are removed after the adjustment

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("bundle", bundle);
    v("points_per_keyframe", points_per_keyframe, Range(0, 1e6), "points; 0: all");
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
};

// A joint solution's unknowns and observations, and where in the merged map they come from.
struct MergedBundle {
  BundleProblem problem;               // poses: keyframes of the map; cameras: submaps
  std::vector<int> points;             // per point of the problem: index into MergedMap::points
  std::vector<TrackElement> elements;  // per observation
  std::vector<char> is_free;           // per keyframe
  std::vector<char> is_touched;        // per point of the map: a free keyframe sees it
};

// All poses but that of keyframe 0 are free, which is as well if hold_first is false; with a window, those of its
// keyframes, and the points they see. Pixels are corrected by the shutters of the map.
MergedBundle MakeMergedBundle(const MergedMap& map, int points_per_keyframe, const std::vector<int>* window = nullptr,
                              bool hold_first = true);

// Puts the solution into the map. Points that are not in the problem follow: they move with their keyframes, then each
// finds its own place. Outliers are removed, points left with fewer than two observations are culled, and each
// keyframe's scale is measured anew. Returns how many observations were removed.
int TakeMergedBundle(const MergedBundle& bundle, double outlier_squared_error, MergedMap* map);

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
