#include "procs/frontend/pair_extension.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapmend {
namespace {

constexpr size_t kMaxTrials = 3;  // keyframes, those with most points in common first

struct Candidate {
  KeyframeIndex keyframe;
  int num_common = 0;
};

// Points of the keyframe that the frame seems to show.
int CountCommon(const WorkingKeyframe& keyframe, const Frame& frame) {
  std::vector<int> with_point;  // features
  for (size_t i = 0; i < keyframe.points.size(); ++i) {
    if (!keyframe.points[i].IsNone()) with_point.push_back(static_cast<int>(i));
  }
  if (with_point.empty()) return 0;
  return static_cast<int>(MatchBruteForce(keyframe.frame->features, frame.features, {}, with_point).size());
}

// Of the features of a keyframe, as the map has them; 0: none.
std::vector<double> DepthsInMap(const WorkingKeyframe& keyframe, const WorkingMap& map) {
  std::vector<double> depths(keyframe.points.size(), 0);
  for (size_t i = 0; i < depths.size(); ++i) {
    if (!keyframe.points[i].IsNone())
      depths[i] = (keyframe.cam_from_submap * map.Point(keyframe.points[i]).position).z();
  }
  return depths;
}

}  // namespace

TrackResult PairExtension::FromPair(KeyframeIndex keyframe, const PhotoPair& pair, const WorkingMap& map) const {
  TrackResult result;
  result.reason = LossReason::kTooFewMatches;
  const WorkingKeyframe& reference = map.Keyframe(keyframe);
  const std::vector<double> depths = DepthsInMap(reference, map);
  const TwoViewCandidate* motion = nullptr;
  DepthAgreement best;
  int rival = 0;
  for (const TwoViewCandidate& m : pair.motions) {
    const DepthAgreement agreement = Compare(depths, DepthsInFirst(pair, m), options_.max_scale_spread);
    if (agreement.num_agreeing < options_.min_agreeing * agreement.num_common) continue;
    if (agreement.num_agreeing > best.num_agreeing) {
      rival = best.num_agreeing;
      best = agreement;
      motion = &m;
    } else {
      rival = std::max(rival, agreement.num_agreeing);
    }
  }
  if (getenv("DBG")) fprintf(stderr, "DBG   extend %d-%d motions %zu: %d of %d agree, rival %d\n", pair.first->index, pair.second->index, pair.motions.size(), best.num_agreeing, best.num_common, rival);
  if (best.num_agreeing < options_.min_common || rival > options_.max_rival * best.num_agreeing) return result;
  const Rigid3 submap_from_reference = reference.cam_from_submap.Inverse();
  Rigid3 frame_from_reference = motion->second_from_first;
  frame_from_reference.translation *= best.scale;
  result.cam_from_submap = frame_from_reference * reference.cam_from_submap;
  result.points.assign(pair.second->features.Size(), PointIndex());
  for (size_t i = 0; i < motion->matches.size(); ++i) {
    const Match& m = pair.found[motion->matches[i]];
    const Eigen::Vector3d x = best.scale * motion->points[i];
    if (reference.points[m.a].IsNone()) {
      result.new_points.push_back({FeatureIndex(m.a), FeatureIndex(m.b), submap_from_reference * x});
    } else if (std::abs(depths[m.a] - x.z()) <= options_.max_scale_spread * x.z()) {
      result.points[m.b] = reference.points[m.a];
    }
  }
  result.num_inliers = static_cast<int>(motion->matches.size());
  result.reference_keyframe = keyframe;
  result.method = TrackMethod::kDescriptors;
  result.success = true;
  result.reason = LossReason::kNone;
  return result;
}

TrackResult PairExtension::Track(const std::vector<KeyframeIndex>& hints, const FramePtr& frame,
                                 const WorkingMap& map) const {
  std::vector<Candidate> candidates;
  for (const KeyframeIndex k : hints) {
    const int num_common = CountCommon(map.Keyframe(k), *frame);
    if (num_common >= options_.min_common) candidates.push_back({k, num_common});
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.num_common > b.num_common; });
  if (candidates.size() > kMaxTrials) candidates.resize(kMaxTrials);
  TrackResult result;
  result.reason = LossReason::kTooFewMatches;
  for (const Candidate& c : candidates) {
    const PhotoPair pair = PairOf(map.Keyframe(c.keyframe).frame, frame, options_, camera_, pyramid_);
    result = FromPair(c.keyframe, pair, map);
    if (result.success) break;
  }
  return result;
}

}  // namespace mapmend
