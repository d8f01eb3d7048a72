#include "libs/mosaic/ground_plane.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "libs/base/median.h"
#include "libs/base/random.h"

namespace mapmend {
namespace {

constexpr int kNumSamples = 500;
constexpr double kMinShare = 0.25;       // of the points, to be believed
constexpr double kCamerasAbove = 0.98;   // of the cameras
constexpr double kMaxSteepness = 0.64;   // sine of the angle between the plane and the way of the cameras: 40 degrees
constexpr double kMinUprightness = 0.5;  // cosine of the angle to where up is for the camera: 60 degrees
constexpr double kToleranceOfDistance = 0.02;  // of the median distance from cameras to points
constexpr double kMinTurns = 0.05;  // second to first eigenvalue of the horizontal axes, to know what is horizontal

using Points = std::vector<Eigen::Vector3d>;

Eigen::Vector3d MeanAxis(const Trajectory& cameras, const Eigen::Vector3d& axis) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const StampedPose& pose : cameras) sum += pose.world_from_camera.rotation * axis;
  return sum.normalized();
}

// Direction of the longest extent, zero without one.
Eigen::Vector3d MainDirection(const Trajectory& cameras) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const StampedPose& pose : cameras) mean += pose.world_from_camera.translation / cameras.size();
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const StampedPose& pose : cameras) {
    const Eigen::Vector3d d = pose.world_from_camera.translation - mean;
    spread += d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(spread);
  if (solver.eigenvalues()[2] <= 0) return Eigen::Vector3d::Zero();
  return solver.eigenvectors().col(2);
}

class GroundSearch {
 public:
  GroundSearch(const Points& points, const Trajectory& cameras, double tolerance)
      : points_(points),
        cameras_(cameras),
        tolerance_(tolerance),
        up_(MeanAxis(cameras, Eigen::Vector3d(0, -1, -1))),
        way_(MainDirection(cameras)) {}

  std::optional<GroundPlane3> Find() const {
    if (points_.size() < 3 || cameras_.empty()) return std::nullopt;
    Random random(1);
    GroundPlane3 best;
    for (int i = 0; i < kNumSamples; ++i) {
      const int n = static_cast<int>(points_.size());
      const Eigen::Vector3d &a = points_[random.Below(n)], &b = points_[random.Below(n)], &c = points_[random.Below(n)];
      const Eigen::Vector3d normal = (b - a).cross(c - a);
      if (normal.norm() < 1e-12) continue;
      Take(normal.normalized(), a, &best);
    }
    for (int round = 0; round < 3 && best.share > 0; ++round) Refine(&best);
    return best.share >= kMinShare ? std::optional(best) : std::nullopt;
  }

 private:
  // Replaces best if this is better.
  void Take(Eigen::Vector3d normal, const Eigen::Vector3d& on_plane, GroundPlane3* best) const {
    if (normal.dot(up_) < 0) normal = -normal;
    if (normal.dot(up_) < kMinUprightness || std::abs(normal.dot(way_)) > kMaxSteepness) return;
    const double offset = normal.dot(on_plane);
    const auto above = std::count_if(cameras_.begin(), cameras_.end(), [&](const StampedPose& pose) {
      return normal.dot(pose.world_from_camera.translation) > offset;
    });
    if (static_cast<double>(above) < kCamerasAbove * static_cast<double>(cameras_.size())) return;
    const auto on = std::count_if(points_.begin(), points_.end(), [&](const Eigen::Vector3d& p) {
      return std::abs(normal.dot(p) - offset) <= tolerance_;
    });
    const double share = static_cast<double>(on) / static_cast<double>(points_.size());
    if (share > best->share) *best = {normal, offset, share};
  }

  // Least squares over the points on the plane.
  void Refine(GroundPlane3* best) const {
    Points on;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& p : points_) {
      if (std::abs(best->normal.dot(p) - best->offset) > tolerance_) continue;
      on.push_back(p);
      mean += p;
    }
    mean /= static_cast<double>(on.size());
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3d& p : on) spread += (p - mean) * (p - mean).transpose();
    Take(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0), mean, best);
  }

  const Points& points_;
  const Trajectory& cameras_;
  const double tolerance_;
  const Eigen::Vector3d up_, way_;
};

// Up from how the camera is held: without rolling, its x axes are horizontal. If they have only one direction, what is
// across that one and against the view and the image's y axis.
Eigen::Vector3d UpOfCameras(const Trajectory& cameras) {
  const Eigen::Vector3d rough = MeanAxis(cameras, Eigen::Vector3d(0, -1, -1));
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const StampedPose& pose : cameras) {
    const Eigen::Vector3d x = pose.world_from_camera.rotation * Eigen::Vector3d::UnitX();
    spread += x * x.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(spread);
  if (solver.eigenvalues()[1] > kMinTurns * solver.eigenvalues()[2]) {
    const Eigen::Vector3d up = solver.eigenvectors().col(0);
    return up.dot(rough) < 0 ? Eigen::Vector3d(-up) : up;
  }
  const Eigen::Vector3d upright = MeanAxis(cameras, Eigen::Vector3d(0, -1, 0));
  const Eigen::Vector3d x = solver.eigenvectors().col(2);
  return (upright - upright.dot(x) * x).normalized();
}

// The distance from the cameras to the points, roughly: each keyframe's median would cost more and say no more.
double TypicalDistance(const Points& points, const Trajectory& cameras) {
  std::vector<double> distances;
  for (size_t i = 0; i < points.size(); i += 1 + points.size() / 500) {
    double nearest = (points[i] - cameras.front().world_from_camera.translation).norm();
    for (const StampedPose& pose : cameras)
      nearest = std::min(nearest, (points[i] - pose.world_from_camera.translation).norm());
    distances.push_back(nearest);
  }
  return Median(distances);
}

}  // namespace

std::optional<GroundPlane3> FindGroundPlane(const std::vector<Eigen::Vector3d>& points, const Trajectory& cameras,
                                            double tolerance) {
  return GroundSearch(points, cameras, tolerance).Find();
}

LevelFrame FindLevelFrame(const std::vector<Eigen::Vector3d>& points, const Trajectory& cameras,
                          const Eigen::Vector3d& to_the_right) {
  LevelFrame frame;
  if (cameras.empty()) return frame;
  frame.ground = FindGroundPlane(points, cameras, kToleranceOfDistance * TypicalDistance(points, cameras));
  const Eigen::Vector3d up = frame.ground ? frame.ground->normal : UpOfCameras(cameras);
  const Eigen::Vector3d start = cameras.front().world_from_camera.translation;
  const Eigen::Vector3d origin =
      frame.ground ? Eigen::Vector3d(start - (up.dot(start) - frame.ground->offset) * up) : start;
  Eigen::Vector3d x = to_the_right - to_the_right.dot(up) * up;
  x = x.norm() > 1e-6 ? Eigen::Vector3d(x.normalized()) : up.unitOrthogonal();
  Eigen::Matrix3d R;
  R << x.transpose(), up.cross(x).transpose(), up.transpose();
  frame.level_from_map = Rigid3(R, -(R * origin));
  return frame;
}

}  // namespace mapmend
