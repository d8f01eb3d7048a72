#include "procs/frontend/keyframe_policy.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "libs/geometry/triangulation.h"

namespace mapmend {
namespace {

constexpr double kNoParallax = 1e-4;  // radians

double Angle(const Eigen::Vector3d& point, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::clamp(CosIntersectionAngle(point, a, b), -1.0, 1.0));
}

}  // namespace

double ParallaxGrowth(const WorkingMap& map, const TrackResult& tracked) {
  const Eigen::Vector3d center = tracked.cam_from_submap.Center();
  std::vector<double> growths;
  for (const PointIndex p : tracked.points) {
    if (p.IsNone() || map.Point(p).observations.empty()) continue;
    const WorkingPoint& point = map.Point(p);
    const auto center_of = [&](const WorkingObservation& o) {
      return map.Keyframe(o.keyframe).cam_from_submap.Center();
    };
    double widest = 0;
    for (const WorkingObservation& o : point.observations)
      widest = std::max(widest, Angle(point.position, center, center_of(o)));
    const double known =
        Angle(point.position, center_of(point.observations.front()), center_of(point.observations.back()));
    growths.push_back(widest / std::max(known, kNoParallax));
  }
  if (growths.empty()) return 0;
  const auto middle = growths.begin() + static_cast<long>(growths.size() / 2);
  std::nth_element(growths.begin(), middle, growths.end());
  return *middle;
}

KeyframeEvidence KeyframePolicy::Measure(const WorkingMap& map, const TrackResult& tracked) const {
  KeyframeEvidence evidence;
  evidence.num_inliers = tracked.num_inliers;
  const WorkingKeyframe& key = map.Keyframe(tracked.reference_keyframe);
  // Points that few keyframes saw are often not found again, through no fault of this frame's.
  const bool is_early = map.LastKeyframe() <= options_.solid_early;
  const auto enough = static_cast<size_t>(is_early ? options_.solid_early : options_.solid_observations);
  const auto is_solid = [&](PointIndex p) { return !p.IsNone() && map.Point(p).observations.size() >= enough; };
  evidence.solid_points = static_cast<int>(std::count_if(key.points.begin(), key.points.end(), is_solid));
  if (map.LastKeyframe() < options_.young_keyframes) evidence.parallax_growth = ParallaxGrowth(map, tracked);
  const auto axis = [](const Rigid3& cam_from_submap) {
    return Eigen::Vector3d(cam_from_submap.rotation.conjugate() * Eigen::Vector3d::UnitZ());
  };
  const double cos_turn = axis(tracked.cam_from_submap).dot(axis(key.cam_from_submap));
  evidence.turn_deg = std::acos(std::clamp(cos_turn, -1.0, 1.0)) * 180 / M_PI;
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
  if (evidence.turn_deg > options_.max_turn_deg) return true;
  if (evidence.parallax_growth > options_.parallax_growth) return true;
  return evidence.cos_angle < std::cos(options_.max_angle_deg * M_PI / 180);
}

}  // namespace mapmend
