#include "procs/merger/loop_consistency.h"

#include <algorithm>
#include <iterator>
#include <vector>

namespace mapmend {

LoopJudgement JudgeLoop(const Submap& submap, const ConnectedFrames& loop, const CycleConsistencyOptions& options) {
  LoopJudgement judgement;
  const auto first = submap.keyframes.find(std::min(loop.keyframe_a, loop.keyframe_b));
  const auto last = submap.keyframes.find(std::max(loop.keyframe_a, loop.keyframe_b));
  if (first == submap.keyframes.end() || last == submap.keyframes.end()) return judgement;
  const double distance = MedianDepth(submap, last->second);
  std::vector<double> displacements;
  for (const auto& [point, other] : loop.common_points) {
    const auto it = submap.points.find(point);
    if (it == submap.points.end()) continue;
    displacements.push_back((loop.b_from_a * it->second.position - it->second.position).norm());
  }
  if (displacements.empty() || !(distance > 0)) return judgement;
  const auto middle = displacements.begin() + static_cast<long>(displacements.size() / 2);
  std::nth_element(displacements.begin(), middle, displacements.end());
  double path = 0;
  for (auto it = first; it != last; ++it) {
    path += (std::next(it)->second.cam_from_submap.Center() - it->second.cam_from_submap.Center()).norm();
  }
  judgement.displacement = *middle / distance;
  judgement.allowed = options.per_edge + options.drift * path / distance;
  judgement.plausible = judgement.displacement <= judgement.allowed;
  return judgement;
}

}  // namespace mapmend
