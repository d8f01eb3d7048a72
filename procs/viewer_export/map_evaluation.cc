#include "procs/viewer_export/map_evaluation.h"

#include <algorithm>
#include <iterator>
#include <map>

#include "libs/connecting/local_window.h"

namespace mapmend {

DepthShare ShareOfDepth(const Submap& submap, const Evaluation& evaluation) {
  DepthShare share;
  if (!evaluation.success) return share;
  std::map<int64_t, double> depth_at;  // metres, by time
  for (const auto& [id, keyframe] : submap.keyframes) {
    const double depth = evaluation.reference_from_estimate.scale * MedianDepth(submap, keyframe);
    if (depth > 0) depth_at[keyframe.utime] = depth;
  }
  if (depth_at.empty()) return share;
  const Trajectory trajectory = TrackedTrajectory(submap);
  std::vector<double> depths;
  for (size_t i = 0; i < evaluation.pairs.size(); ++i) {
    const int64_t utime = trajectory[evaluation.pairs[i].estimate].utime;
    auto nearest = depth_at.lower_bound(utime);
    if (nearest == depth_at.end() ||
        (nearest != depth_at.begin() && utime - std::prev(nearest)->first < nearest->first - utime))
      --nearest;
    depths.push_back(nearest->second);
    const double value = evaluation.errors[i] / nearest->second;
    if (value > share.largest) {
      share.largest = value;
      share.utime = utime;
    }
  }
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  share.median_depth = depths[depths.size() / 2];
  return share;
}

MapEvaluation EvaluateMap(const Snapshot& snapshot, const GroundTruth& ground_truth) {
  MapEvaluation result;
  const EvaluationOptions& options = ground_truth.options;
  for (const SnapshotComponent& component : snapshot.components) {
    result.components.push_back(EvaluateTrajectory(ToTrajectory(component.frames), ground_truth.trajectory, options));
  }
  for (const SnapshotSubmap& submap : snapshot.submaps) {
    result.submaps.push_back(EvaluateTrajectory(TrackedTrajectory(*submap.submap), ground_truth.trajectory, options));
    result.depth_shares.push_back(ShareOfDepth(*submap.submap, result.submaps.back()));
  }
  return result;
}

}  // namespace mapmend
