#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>

#include "libs/drawing/top_view.h"

namespace mapmend {
namespace {

// Where "up" is for a person who holds, or flies, the camera: against the view for a camera that looks down, against
// the image's y axis for one held upright; their sum serves all in between.
Eigen::Vector3d MeanUp(const Trajectory& trajectory) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const StampedPose& pose : trajectory) {
    up -= pose.world_from_camera.rotation * Eigen::Vector3d(0, 1, 1);
  }
  return up.norm() > 1e-9 ? Eigen::Vector3d(up.normalized()) : Eigen::Vector3d(0, 0, 1);
}

// Turns the axes in their plane so that straight strips, and those across them, run along the axes. The mean direction
// modulo 90 degrees is the angle of the sum of exp(4i angle), weighted by length; without a clear mean the axes stay.
void AlignWithStrips(const Trajectory& trajectory, PlaneView* view) {
  std::complex<double> sum = 0;
  double total = 0;
  for (size_t i = 1; i < trajectory.size(); ++i) {
    const Eigen::Vector2d step =
        view->Project(trajectory[i].world_from_camera.translation - trajectory[i - 1].world_from_camera.translation);
    sum += std::polar(step.norm(), 4 * std::atan2(step.y(), step.x()));
    total += step.norm();
  }
  if (total <= 0 || std::abs(sum) < 0.4 * total) return;
  const double angle = std::arg(sum) / 4;
  const Eigen::Vector3d x = view->x_axis, y = view->y_axis;
  view->x_axis = std::cos(angle) * x + std::sin(angle) * y;
  view->y_axis = std::cos(angle) * y - std::sin(angle) * x;
  Eigen::Vector2d low = view->Project(trajectory.front().world_from_camera.translation), high = low;
  for (const StampedPose& pose : trajectory) {
    low = low.cwiseMin(view->Project(pose.world_from_camera.translation));
    high = high.cwiseMax(view->Project(pose.world_from_camera.translation));
  }
  if (high.y() - low.y() > high.x() - low.x()) {
    const Eigen::Vector3d old_x = view->x_axis;
    view->x_axis = view->y_axis;
    view->y_axis = -old_x;
  }
}

}  // namespace

PlaneView DominantPlane(const Trajectory& trajectory) {
  PlaneView view;
  if (trajectory.empty()) return view;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const StampedPose& pose : trajectory) mean += pose.world_from_camera.translation;
  mean /= static_cast<double>(trajectory.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const StampedPose& pose : trajectory) {
    const Eigen::Vector3d d = pose.world_from_camera.translation - mean;
    covariance += d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  const Eigen::Vector3d up = MeanUp(trajectory);
  view.x_axis = solver.eigenvectors().col(2);
  // Wiggles of less than a twentieth of the length say nothing about the ground.
  const bool line = solver.eigenvalues()[1] < 0.0025 * solver.eigenvalues()[2];
  Eigen::Vector3d normal = solver.eigenvectors().col(0);
  if (line || solver.eigenvalues()[2] <= 0) {
    if (solver.eigenvalues()[2] <= 0) view.x_axis = up.unitOrthogonal();
    normal = up - up.dot(view.x_axis) * view.x_axis;
    if (normal.norm() < 1e-6) normal = view.x_axis.unitOrthogonal();
    normal.normalize();
  }
  if (normal.dot(up) < 0) normal = -normal;
  view.y_axis = normal.cross(view.x_axis);
  AlignWithStrips(trajectory, &view);
  // The start lies on the left.
  if (view.x_axis.dot(trajectory.front().world_from_camera.translation - mean) > 0) {
    view.x_axis = -view.x_axis;
    view.y_axis = -view.y_axis;
  }
  return view;
}

PlaneView GroundPlane(const Trajectory& ground_truth) {
  PlaneView view;
  if (ground_truth.empty()) return view;
  Eigen::Vector3d low = ground_truth.front().world_from_camera.translation, high = low;
  for (const StampedPose& pose : ground_truth) {
    low = low.cwiseMin(pose.world_from_camera.translation);
    high = high.cwiseMax(pose.world_from_camera.translation);
  }
  const Eigen::Vector3d extent = high - low;
  int vertical = 0;
  extent.minCoeff(&vertical);
  if (vertical == 2 || extent[2] <= 1.5 * extent[vertical]) return view;
  Eigen::Vector3d normal = Eigen::Vector3d::Unit(vertical);
  if (normal.dot(MeanUp(ground_truth)) < 0) normal = -normal;
  view.x_axis = Eigen::Vector3d::Unit(vertical == 0 ? 1 : 0);
  view.y_axis = normal.cross(view.x_axis);
  return view;
}

std::vector<std::vector<Eigen::Vector2d>> ProjectPieces(const Trajectory& trajectory, const PlaneView& view,
                                                        double gap_factor) {
  std::vector<int64_t> steps;
  for (size_t i = 1; i < trajectory.size(); ++i) steps.push_back(trajectory[i].utime - trajectory[i - 1].utime);
  double longest = 0;
  if (!steps.empty()) {
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    longest = gap_factor * static_cast<double>(*middle);
  }
  std::vector<std::vector<Eigen::Vector2d>> pieces;
  for (size_t i = 0; i < trajectory.size(); ++i) {
    if (i == 0 || static_cast<double>(trajectory[i].utime - trajectory[i - 1].utime) > longest) pieces.emplace_back();
    pieces.back().push_back(view.Project(trajectory[i].world_from_camera.translation));
  }
  return pieces;
}

}  // namespace mapmend
