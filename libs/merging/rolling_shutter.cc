#include "libs/merging/rolling_shutter.h"

#include <algorithm>
#include <map>

#include "libs/optim/reprojection_cost.h"

namespace mapmend {
namespace {

constexpr double kMaxGap = 3;  // of the median time between frames

Eigen::Vector3d RotationVector(const Eigen::Quaterniond& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

int64_t MedianInterval(const std::map<int64_t, Rigid3>& poses) {
  std::vector<int64_t> intervals;
  for (auto it = poses.begin(); it != poses.end() && std::next(it) != poses.end(); ++it) {
    intervals.push_back(std::next(it)->first - it->first);
  }
  if (intervals.empty()) return 0;
  const auto middle = intervals.begin() + static_cast<long>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  return *middle;
}

}  // namespace

std::vector<CameraMotion> KeyframeMotions(const Submap& submap) {
  std::map<int64_t, Rigid3> poses;  // cam_from_submap by time
  for (const TrackedFrame& frame : submap.frames) poses[frame.utime] = submap.CamFromSubmap(frame);
  for (const auto& [id, keyframe] : submap.keyframes) poses[keyframe.utime] = keyframe.cam_from_submap;
  const double max_gap = kMaxGap * static_cast<double>(MedianInterval(poses));
  std::vector<CameraMotion> motions;
  for (const auto& [id, keyframe] : submap.keyframes) {
    CameraMotion motion;
    const auto at = poses.find(keyframe.utime);
    auto first = at, last = at;
    if (at != poses.begin() && static_cast<double>(at->first - std::prev(at)->first) <= max_gap) --first;
    if (std::next(at) != poses.end() && static_cast<double>(std::next(at)->first - at->first) <= max_gap) ++last;
    if (first != last) {
      const double seconds = 1e-6 * static_cast<double>(last->first - first->first);
      const Rigid3 submap_from_first = first->second.Inverse(), submap_from_last = last->second.Inverse();
      motion.velocity =
          keyframe.cam_from_submap.rotation * (submap_from_last.translation - submap_from_first.translation) / seconds;
      motion.turn_rate = RotationVector(first->second.rotation * submap_from_last.rotation) / seconds;
    }
    motions.push_back(motion);
  }
  return motions;
}

double LinePlace(const Pinhole& ideal, const Camera& real, const Eigen::Vector2d& pixel, ScanLines lines) {
  const bool as_is = real.height <= 0 || !real.HasDistortion();
  const Eigen::Vector2d in_image = as_is ? pixel : real.Project(ideal.Unproject(pixel));
  const Eigen::Vector2d size =
      as_is ? Eigen::Vector2d(ideal.width, ideal.height) : Eigen::Vector2d(real.width, real.height);
  const int axis = lines == ScanLines::kRows ? 1 : 0;
  return in_image[axis] / size[axis] - 0.5;
}

Eigen::Vector2d ShutterCorrection(const Pinhole& camera, const CameraMotion& motion, const Eigen::Vector3d& x_cam,
                                  double line_place) {
  constexpr double kMinDepth = 1e-6;  // as ReprojectionCost's
  if (x_cam.z() < kMinDepth) return Eigen::Vector2d::Zero();
  return line_place * (ProjectionJacobian(camera, x_cam) * (motion.velocity + motion.turn_rate.cross(x_cam)));
}

}  // namespace mapmend
