#include "procs/frontend/keyframe_policy.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "libs/geometry/triangulation.h"

namespace mapmend {

KeyframeEvidence KeyframePolicy::Measure(const WorkingMap& map, const TrackResult& tracked) const {
  KeyframeEvidence evidence;
  evidence.num_inliers = tracked.num_inliers;
  const WorkingKeyframe& key = map.Keyframe(tracked.reference_keyframe);
  // Points that few keyframes saw are often not found again, through no fault of this frame's.
  const bool is_early = map.LastKeyframe() <= options_.solid_early;
  const auto enough = static_cast<size_t>(is_early ? options_.solid_early : options_.solid_observations);
  const auto is_solid = [&](PointIndex p) { return !p.IsNone() && map.Point(p).observations.size() >= enough; };
  evidence.solid_points = static_cast<int>(std::count_if(key.points.begin(), key.points.end(), is_solid));
  const Eigen::Vector3d center = tracked.cam_from_submap.Center(), key_center = key.cam_from_submap.Center();
  std::vector<double> cosines;
  for (const PointIndex p : tracked.points) {
    if (!p.IsNone()) cosines.push_back(CosIntersectionAngle(map.Point(p).position, center, key_center));
  }
  if (cosines.empty()) return evidence;
  std::nth_element(cosines.begin(), cosines.begin() + cosines.size() / 2, cosines.end());
  evidence.cos_angle = cosines[cosines.size() / 2];
  return evidence;
}

bool KeyframePolicy::NeedsKeyframe(const KeyframeEvidence& evidence) const {
  if (evidence.num_inliers < options_.min_shared * evidence.solid_points) return true;
  if (evidence.num_inliers < options_.comfortable_inliers) return true;
  return evidence.cos_angle < std::cos(options_.max_angle_deg * M_PI / 180);
}

}  // namespace mapmend
