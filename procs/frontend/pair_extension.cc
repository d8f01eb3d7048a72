#include "procs/frontend/pair_extension.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapmend {
namespace {

constexpr size_t kMaxTrials = 3;  // keyframes, those with most points in common first

// Points of the keyframe that the frame seems to show.
int CountCommon(const WorkingKeyframe& keyframe, const Frame& frame) {
  std::vector<int> with_point;  // features
  for (size_t i = 0; i < keyframe.points.size(); ++i) {
    if (!keyframe.points[i].IsNone()) with_point.push_back(static_cast<int>(i));
  }
  if (with_point.empty()) return 0;
  return static_cast<int>(MatchBruteForce(keyframe.frame->features, frame.features, {}, with_point).size());
}

Depths DepthsInMap(const WorkingKeyframe& keyframe, const WorkingMap& map) {
  Depths depths(keyframe.points.size(), 0);
  for (size_t i = 0; i < depths.size(); ++i) {
    if (!keyframe.points[i].IsNone())
      depths[i] = (keyframe.cam_from_submap * map.Point(keyframe.points[i]).position).z();
  }
  return depths;
}

TrackResult Failed() {
  TrackResult failed;
  failed.reason = LossReason::kTooFewMatches;
  return failed;
}

}  // namespace

TrackResult PairExtension::FromPair(KeyframeIndex keyframe, const PhotoPair& pair, const WorkingMap& map) const {
  const WorkingKeyframe& reference = map.Keyframe(keyframe);
  const Depths depths = DepthsInMap(reference, map);
  MotionVote vote(options_);
  for (const TwoViewCandidate& m : pair.motions)
    vote.Add(m, Compare(depths, DepthsInFirst(pair, m), options_.max_depth_spread));
  if (!vote.IsClear()) return Failed();
  const TwoViewCandidate& motion = vote.Winner();
  Rigid3 frame_from_reference = motion.second_from_first;
  frame_from_reference.translation *= vote.Scale();
  TrackResult result;
  result.success = true;
  result.method = TrackMethod::kPair;
  result.reference_keyframe = keyframe;
  result.cam_from_submap = frame_from_reference * reference.cam_from_submap;
  result.num_inliers = static_cast<int>(motion.matches.size());
  result.points.assign(pair.second->features.Size(), PointIndex());
  const Rigid3 submap_from_reference = reference.cam_from_submap.Inverse();
  for (size_t i = 0; i < motion.matches.size(); ++i) {
    const Match& m = pair.found[motion.matches[i]];
    const Eigen::Vector3d x = vote.Scale() * motion.points[i];
    if (reference.points[m.a].IsNone()) {
      result.new_points.push_back({FeatureIndex(m.a), FeatureIndex(m.b), submap_from_reference * x});
    } else if (std::abs(depths[m.a] - x.z()) <= options_.max_depth_spread * x.z()) {
      result.points[m.b] = reference.points[m.a];
    }
  }
  return result;
}

TrackResult PairExtension::Track(const std::vector<KeyframeIndex>& hints, const FramePtr& frame,
                                 const WorkingMap& map) const {
  std::vector<std::pair<int, KeyframeIndex>> candidates;  // points in common
  for (const KeyframeIndex k : hints) {
    const int num_common = CountCommon(map.Keyframe(k), *frame);
    if (num_common >= options_.min_common) candidates.emplace_back(num_common, k);
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  for (size_t i = 0; i < std::min(candidates.size(), kMaxTrials); ++i) {
    const KeyframeIndex k = candidates[i].second;
    TrackResult result = FromPair(k, PairOf(map.Keyframe(k).frame, frame, options_, camera_, pyramid_), map);
    if (result.success) return result;
  }
  return Failed();
}

}  // namespace mapmend
