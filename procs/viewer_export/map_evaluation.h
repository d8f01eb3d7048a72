#pragma once

#include <string>
#include <vector>

#include "libs/geometry/alignment.h"
#include "procs/viewer_export/snapshot.h"

namespace mapmend {

struct GroundTruth {
  std::string file;
  Trajectory trajectory;
};

// The map against ground truth: every component with its own Sim(3) alignment, and every submap as it was tracked with
// its own, which shows errors of tracking apart from errors of merging.
struct MapEvaluation {
  std::vector<Evaluation> components;  // as Snapshot::components
  std::vector<Evaluation> submaps;     // as Snapshot::submaps
};

MapEvaluation EvaluateMap(const Snapshot& snapshot, const GroundTruth& ground_truth);

}  // namespace mapmend
