#include "libs/merging/rolling_shutter.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
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

// A camera near a keyframe: how long after it, and its place and attitude in the keyframe's camera frame.
struct Nearby {
  double seconds = 0;
  Eigen::Vector3d place, turn;  // turn: rotation vector
};

using Poses = std::map<int64_t, Rigid3>;  // cam_from_submap by time

Nearby Relative(const Poses::value_type& keyframe, const Poses::value_type& other) {
  const Rigid3 key_from_other = keyframe.second * other.second.Inverse();
  return {1e-6 * static_cast<double>(other.first - keyframe.first), key_from_other.translation,
          RotationVector(key_from_other.rotation)};
}

// The frames before (or after) a keyframe, the nearest first, at most two, each no more than max_gap from the one next
// to it.
template <typename Iterator>
std::vector<Nearby> NearbyFrames(const Poses::value_type& keyframe, Iterator at, Iterator end, double max_gap) {
  std::vector<Nearby> nearby;
  int64_t utime = keyframe.first;
  for (; at != end && nearby.size() < 2 && std::abs(static_cast<double>(at->first - utime)) <= max_gap; ++at) {
    nearby.push_back(Relative(keyframe, *at));
    utime = at->first;
  }
  return nearby;
}

// Slopes at zero, of what the frames before and after say. A camera that is carried swings faster than the difference
// of two neighbours shows: with two frames on each side the error is of fourth order in their distance, else of second.
CameraMotion SlopeAtZero(const std::vector<Nearby>& before, const std::vector<Nearby>& after) {
  const Nearby here{0, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  const auto slope = [](const Nearby& from, const Nearby& to) {
    return CameraMotion{(to.place - from.place) / (to.seconds - from.seconds),
                        (to.turn - from.turn) / (to.seconds - from.seconds)};
  };
  if (before.empty() && after.empty()) return {};
  if (before.empty() || after.empty()) return before.empty() ? slope(here, after[0]) : slope(before[0], here);
  const CameraMotion near = slope(before[0], after[0]);
  if (before.size() < 2 || after.size() < 2) return near;
  const double near_s = after[0].seconds - before[0].seconds, far_s = after[1].seconds - before[1].seconds;
  const double ratio = far_s / near_s;
  constexpr double kEven = 0.1;  // of the ratio: else the frames do not lie evenly
  if (std::abs(ratio - 2) > 2 * kEven || std::abs(before[0].seconds + after[0].seconds) > kEven * near_s) return near;
  const CameraMotion far = slope(before[1], after[1]);
  const double weight = ratio * ratio / (ratio * ratio - 1);  // Richardson's
  return {weight * near.velocity + (1 - weight) * far.velocity, weight * near.turn_rate + (1 - weight) * far.turn_rate};
}

}  // namespace

std::vector<CameraMotion> KeyframeMotions(const Submap& submap) {
  Poses poses;
  for (const TrackedFrame& frame : submap.frames) poses[frame.utime] = submap.CamFromSubmap(frame);
  for (const auto& [id, keyframe] : submap.keyframes) poses[keyframe.utime] = keyframe.cam_from_submap;
  const double max_gap = kMaxGap * static_cast<double>(MedianInterval(poses));
  std::vector<CameraMotion> motions;
  for (const auto& [id, keyframe] : submap.keyframes) {
    const auto at = poses.find(keyframe.utime);
    motions.push_back(SlopeAtZero(NearbyFrames(*at, std::make_reverse_iterator(at), poses.rend(), max_gap),
                                  NearbyFrames(*at, std::next(at), poses.end(), max_gap)));
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
