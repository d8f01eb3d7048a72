#include "libs/geometry/gap_in_path.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "libs/geometry/left_jacobian.h"

namespace mapmend {
namespace {

constexpr size_t kFewestPoses = 3;
// What the motion is measured over: as long as the gap, at least so many poses.
constexpr size_t kFewestStepsOfMotion = 4;
constexpr size_t kMostPieces = 500;  // of one path that are looked at

// Per second, in the camera's own frame: a screw.
struct Motion {
  Eigen::Vector3d turn, velocity;
};

Rigid3 Follow(const Motion& motion, double seconds) {
  const Eigen::Vector3d w = seconds * motion.turn;
  const double angle = w.norm();
  const Eigen::Quaterniond rotation =
      angle > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, w / angle)) : Eigen::Quaterniond::Identity();
  return {rotation, LeftJacobian(w) * (seconds * motion.velocity)};
}

Motion MotionBetween(const PathPose& from, const PathPose& to) {
  const double seconds = to.seconds - from.seconds;
  const Rigid3 step = from.world_from_cam.Inverse() * to.world_from_cam;
  const Eigen::AngleAxisd turn(step.rotation.w() < 0 ? Eigen::Quaterniond(-step.rotation.coeffs()) : step.rotation);
  const Eigen::Vector3d w = turn.angle() * turn.axis();
  return {w / seconds, LeftJacobian(w).inverse() * step.translation / seconds};
}

// Index of the pose from which the motion up to the one at `end` is measured.
size_t BeginOfMotion(const std::vector<PathPose>& path, size_t end, double seconds) {
  size_t begin = end;
  while (begin > 0 && (end - begin < kFewestStepsOfMotion || path[end].seconds - path[begin - 1].seconds <= seconds))
    --begin;
  return begin;
}

size_t EndOfMotion(const std::vector<PathPose>& path, size_t begin, double seconds) {
  size_t end = begin;
  while (end + 1 < path.size() &&
         (end - begin < kFewestStepsOfMotion || path[end + 1].seconds - path[begin].seconds <= seconds))
    ++end;
  return end;
}

struct Guess {
  Rigid3 before_from_after;
  double scale = 1;
};

// From the pose path[end] of one path to the pose other[begin] of another, or of the same one. None if either stands
// still, or ends there.
std::optional<Guess> MakeGuess(const std::vector<PathPose>& path, size_t end, const std::vector<PathPose>& other,
                               size_t begin, double seconds) {
  const size_t first = BeginOfMotion(path, end, seconds), last = EndOfMotion(other, begin, seconds);
  if (first == end || last == begin) return std::nullopt;
  const Motion leaving = MotionBetween(path[first], path[end]);
  Motion arriving = MotionBetween(other[begin], other[last]);
  const double speed = leaving.velocity.norm(), other_speed = arriving.velocity.norm();
  if (!(speed > 0) || !(other_speed > 0)) return std::nullopt;
  const double scale = speed / other_speed;
  arriving.velocity *= scale;
  return Guess{Follow(leaving, seconds / 2) * Follow(arriving, seconds / 2), scale};
}

struct Errors {
  double position = 0, angle = 0, scale = 0;  // sums of squares
  int num = 0;
};

// What the guess does wrong across pieces of one path: unit is the length of one of its units.
void AddErrors(const std::vector<PathPose>& path, double seconds, double unit, Errors* errors) {
  for (size_t i = 1; i + 2 < path.size(); i += 1 + path.size() / kMostPieces) {
    size_t k = i + 1;
    while (k + 1 < path.size() && path[k].seconds - path[i].seconds < seconds) ++k;
    const double gap = path[k].seconds - path[i].seconds;
    if (k + 1 >= path.size() || gap < seconds) return;
    const std::optional<Guess> guess = MakeGuess(path, i, path, k, gap);
    if (!guess) continue;
    const Rigid3 truth = path[i].world_from_cam.Inverse() * path[k].world_from_cam;
    errors->position += unit * unit * (guess->before_from_after.translation - truth.translation).squaredNorm();
    errors->angle += std::pow(RotationAngle(guess->before_from_after.rotation * truth.rotation.conjugate()), 2);
    errors->scale += std::pow(std::log(guess->scale), 2);
    ++errors->num;
  }
}

double Duration(const std::vector<PathPose>& path) { return path.back().seconds - path.front().seconds; }

}  // namespace

BridgedGap BridgeGap(const std::vector<PathPose>& before, const std::vector<PathPose>& after) {
  BridgedGap gap;
  if (before.size() < kFewestPoses || after.size() < kFewestPoses) return gap;
  gap.seconds = after.front().seconds - before.back().seconds;
  if (!(gap.seconds > 0)) return gap;
  const std::optional<Guess> guess = MakeGuess(before, before.size() - 1, after, 0, gap.seconds);
  if (!guess) return gap;
  gap.success = true;
  gap.before_from_after = guess->before_from_after;
  gap.scale = guess->scale;
  // At most a third of the longer path, so that there is a motion on both sides of each piece.
  const double piece = std::min(gap.seconds, std::max(Duration(before), Duration(after)) / 3);
  Errors errors;
  AddErrors(before, piece, 1, &errors);
  AddErrors(after, piece, gap.scale, &errors);
  if (errors.num == 0) {
    gap.sigma_position = gap.before_from_after.translation.norm();
    gap.sigma_angle = RotationAngle(gap.before_from_after.rotation);
    gap.sigma_scale = 1;
    return gap;
  }
  const double longer = gap.seconds / piece;
  gap.sigma_position = longer * longer * std::sqrt(errors.position / errors.num);
  gap.sigma_angle = longer * longer * std::sqrt(errors.angle / errors.num);
  gap.sigma_scale = longer * std::sqrt(errors.scale / errors.num);
  return gap;
}

}  // namespace mapmend
