#include "procs/viewer_export/map_evaluation.h"

namespace mapmend {

MapEvaluation EvaluateMap(const Snapshot& snapshot, const GroundTruth& ground_truth) {
  MapEvaluation result;
  const EvaluationOptions options;
  for (const SnapshotComponent& component : snapshot.components) {
    result.components.push_back(EvaluateTrajectory(ToTrajectory(component.frames), ground_truth.trajectory, options));
  }
  for (const SnapshotSubmap& submap : snapshot.submaps) {
    result.submaps.push_back(EvaluateTrajectory(TrackedTrajectory(*submap.submap), ground_truth.trajectory, options));
  }
  return result;
}

}  // namespace mapmend
