#pragma once

#include <string>
#include <vector>

#include "libs/geometry/alignment.h"
#include "libs/map_view/snapshot.h"

namespace mapmend {

struct GroundTruth {
  std::string file;
  Trajectory trajectory;
  EvaluationOptions options;
};

// The errors of a submap's frames against how far away the scene was, which is what makes them large or small: an error
// of a metre is much in a kitchen and little from 190 m above a village.
struct DepthShare {
  double largest = 0;       // of error / depth of the scene, over all frames; 0 if no depth is known
  int64_t utime = 0;        // of the frame where it is largest
  double median_depth = 0;  // of the scene over all frames, metres
};

// Depth of the scene at a frame: median depth of the map points that the keyframe nearest in time observes, in the
// scale of evaluation, which must be that of the submap's tracked trajectory.
DepthShare ShareOfDepth(const Submap& submap, const Evaluation& evaluation);

// The map against ground truth: every component with its own Sim(3) alignment, and every submap as it was tracked with
// its own, which shows errors of tracking apart from errors of merging.
struct MapEvaluation {
  std::vector<Evaluation> components;    // as Snapshot::components
  std::vector<Evaluation> submaps;       // as Snapshot::submaps
  std::vector<DepthShare> depth_shares;  // of submaps
};

MapEvaluation EvaluateMap(const Snapshot& snapshot, const GroundTruth& ground_truth);

}  // namespace mapmend
