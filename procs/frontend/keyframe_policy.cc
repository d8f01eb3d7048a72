#include "procs/frontend/keyframe_policy.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "libs/geometry/triangulation.h"

namespace mapmend {

KeyframeEvidence KeyframePolicy::Measure(const WorkingMap& map, const Frame& frame, int reference_keyframe,
                                         int num_inliers) const {
  KeyframeEvidence evidence;
  evidence.num_inliers = num_inliers;
  const Frame& key = *map.Keyframe(reference_keyframe).frame;
  // Points that few keyframes saw are often not found again, through no fault of this frame's.
  const bool is_early = map.LastKeyframe() <= options_.solid_early;
  const auto enough = static_cast<size_t>(is_early ? options_.solid_early : options_.solid_observations);
  const auto is_solid = [&](int p) { return p >= 0 && map.Point(p).observations.size() >= enough; };
  evidence.solid_points = static_cast<int>(std::count_if(key.points.begin(), key.points.end(), is_solid));
  const Eigen::Vector3d center = frame.cam_from_submap.Center(), key_center = key.cam_from_submap.Center();
  std::vector<double> cosines;
  for (const int p : frame.points) {
    if (p >= 0) cosines.push_back(CosIntersectionAngle(map.Point(p).position, center, key_center));
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
