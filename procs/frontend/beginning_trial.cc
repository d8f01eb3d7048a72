#include "procs/frontend/beginning_trial.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "libs/base/median.h"
#include "libs/geometry/triangulation.h"

namespace mapmend {
namespace {

constexpr KeyframeIndex kFirst(0);

// Median angle between the rays from two places to points; 0 without points.
double MedianAngle(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  std::vector<double> angles;
  angles.reserve(points.size());
  for (const Eigen::Vector3d& x : points)
    angles.push_back(std::acos(std::clamp(CosIntersectionAngle(x, a, b), -1.0, 1.0)));
  return Median(std::move(angles));
}

// Shift of the image from one frame to the next, of its width.
double StepOf(const Initialization& initialization, int width) {
  std::vector<double> shifts;
  for (const InitialPoint& p : initialization.points) {
    shifts.push_back((initialization.second->features.keypoints[p.second_feature].pixel -
                      initialization.first->features.keypoints[p.first_feature].pixel)
                         .norm());
  }
  if (shifts.empty()) return std::numeric_limits<double>::infinity();
  return Median(std::move(shifts)) / width / std::max(1, initialization.second->index - initialization.first->index);
}

}  // namespace

void BeginningTrial::Begin(const Initialization& initialization, const WorkingMap& map) {
  is_open_ = StepOf(initialization, camera_.width) <= options_.max_step;
  std::vector<Eigen::Vector3d> points;
  for (const PointIndex p : map.PointsOf(kFirst)) points.push_back(map.Point(p).position);
  ask_at_rad_ = options_.growth * MedianAngle(points, map.Keyframe(kFirst).cam_from_submap.Center(),
                                              map.Keyframe(KeyframeIndex(1)).cam_from_submap.Center());
}

BeginningTrial::Verdict BeginningTrial::Next(const Rigid3& cam_from_submap, const std::vector<PointIndex>& points,
                                             const WorkingMap& map) {
  ++num_frames_;
  if (!is_open_ || num_frames_ >= options_.patience) return Verdict::kStands;
  std::vector<Eigen::Vector3d> in_sight;
  for (const PointIndex p : points) {
    if (p.IsNone()) continue;
    const auto& observations = map.Point(p).observations;
    if (!observations.empty() && observations.front().keyframe == kFirst) in_sight.push_back(map.Point(p).position);
  }
  if (static_cast<int>(in_sight.size()) < options_.min_in_sight) return Verdict::kStands;
  const double angle = MedianAngle(in_sight, map.Keyframe(kFirst).cam_from_submap.Center(), cam_from_submap.Center());
  return angle >= ask_at_rad_ ? Verdict::kAsk : Verdict::kUndecided;
}

bool BeginningTrial::Contradicts(const Initialization& wider, const Rigid3& cam_from_submap,
                                 const WorkingMap& map) const {
  const WorkingKeyframe& first = map.Keyframe(kFirst);
  std::vector<double> scales;  // of the map, as the other has it
  for (const InitialPoint& p : wider.points) {
    const PointIndex known = first.points[p.first_feature];
    if (!known.IsNone()) scales.push_back((first.cam_from_submap * map.Point(known).position).z() / p.position.z());
  }
  if (static_cast<int>(scales.size()) < options_.min_in_sight) return false;
  const double scale = Median(scales);
  if (!(scale > 0)) return true;
  std::vector<double> errors;
  errors.reserve(scales.size());
  for (const double s : scales) errors.push_back(std::abs(s / scale - 1));
  if (Median(std::move(errors)) > options_.max_depth_error) return true;
  const Eigen::Vector3d by_map = (cam_from_submap * first.cam_from_submap.Inverse()).Center() / scale,
                        by_wider = wider.second_from_first.Center();
  return (by_map - by_wider).norm() > options_.max_place_error * by_wider.norm();
}

}  // namespace mapmend
