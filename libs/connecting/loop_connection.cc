#include "libs/connecting/loop_connection.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "libs/base/median.h"
#include "libs/connecting/connection_strength.h"

namespace mapmend {
namespace {

std::optional<KeyframeId> Neighbor(const Submap& submap, KeyframeId keyframe, int step) {
  const auto it = submap.keyframes.find(keyframe);
  if (it == submap.keyframes.end()) return std::nullopt;
  if (step > 0) {
    const auto next = std::next(it);
    return next == submap.keyframes.end() ? std::nullopt : std::optional(next->first);
  }
  return it == submap.keyframes.begin() ? std::nullopt : std::optional(std::prev(it)->first);
}

bool IsKnown(const Connection& loops, KeyframeId a, KeyframeId b) {
  return std::any_of(loops.evidence.begin(), loops.evidence.end(),
                     [&](const ConnectedFrames& e) { return e.keyframe_a == a && e.keyframe_b == b; });
}

}  // namespace

void SeekSupport(const SubmapView& submap, const LoopClosureOptions& options, const VerifyLoop& verify,
                 Connection* loops) {
  for (const int i : FindLoneLoops(submap, loops->evidence, options)) {
    const ConnectedFrames lone = loops->evidence[i];
    bool confirmed = false;
    for (const bool at_b : {true, false}) {
      for (const int step : {1, -1}) {
        const std::optional<KeyframeId> neighbor =
            Neighbor(*submap.submap, at_b ? lone.keyframe_b : lone.keyframe_a, step);
        const KeyframeId a = at_b ? lone.keyframe_a : neighbor.value_or(KeyframeId());
        const KeyframeId b = at_b ? neighbor.value_or(KeyframeId()) : lone.keyframe_b;
        if (confirmed || !neighbor || a == b || IsKnown(*loops, a, b)) continue;
        ConnectedFrames frames = verify(a, b);
        ++loops->num_candidates;
        if (!frames.success) continue;
        confirmed = LoopsAgree(submap, lone, frames, options);
        loops->evidence.push_back(std::move(frames));
      }
    }
  }
}

void EstimateLoops(const SubmapView& submap, const LoopClosureOptions& options, Connection* c) {
  c->verdict = Connection::Verdict::kRejected;
  c->num_connected_frames = c->num_common_points = c->num_inliers = 0;
  c->median_angle_deg = c->strength = c->median_error_px = 0;
  c->b_from_a = Similarity3();
  c->agrees.assign(c->evidence.size(), 0);
  if (c->evidence.empty()) {
    c->reason = "loop closure: none of " + std::to_string(c->num_candidates) +
                " proposed pairs of keyframes holds; best: " + c->best_failure.reason;
    return;
  }
  const LoopJudgement judgement = JudgeLoops(submap, c->evidence, options);
  std::set<std::pair<MapPointId, MapPointId>> common;
  std::vector<double> angles, errors;
  int strongest = 0;
  for (size_t i = 0; i < c->evidence.size(); ++i) {
    if (judgement.verdicts[i] != LoopVerdict::kUsed) continue;
    const ConnectedFrames& e = c->evidence[i];
    c->agrees[i] = 1;
    ++c->num_connected_frames;
    c->num_inliers += e.num_inliers;
    common.insert(e.common_points.begin(), e.common_points.end());
    angles.push_back(e.median_angle_rad * 180 / M_PI);
    errors.push_back(e.median_error_px);
    if (e.num_inliers > strongest) {
      strongest = e.num_inliers;
      c->b_from_a = e.b_from_a;
    }
  }
  c->num_common_points = static_cast<int>(common.size());
  c->median_angle_deg = std::min(Median(angles), kMaxUsefulAngleDeg);
  c->median_error_px = Median(errors);
  c->strength = ConnectionStrength(c->num_connected_frames, c->num_common_points, c->median_angle_deg);
  if (judgement.is_needed) {
    c->verdict = Connection::Verdict::kAccepted;
  } else if (c->num_connected_frames == 0) {
    c->verdict = Connection::Verdict::kDeactivated;
  }
  c->reason = "loop closure: " + judgement.reason;
  const int set_aside = static_cast<int>(c->evidence.size()) - c->num_connected_frames;
  if (set_aside == 0 || c->num_connected_frames == 0) return;
  const auto first = std::find_if(judgement.reasons.begin(), judgement.reasons.end(),
                                  [](const std::string& reason) { return !reason.empty(); });
  c->reason += "; " + std::to_string(set_aside) + " more are set aside: " + *first;
}

}  // namespace mapmend
