#include "libs/optim/reprojection_cost.h"

#include <cmath>

#include "libs/geometry/left_jacobian.h"
#include "libs/optim/behind_camera.h"

namespace mapmend {
namespace {

Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  if (angle < 1e-12) return Eigen::Quaterniond(1, w.x() / 2, w.y() / 2, w.z() / 2).normalized();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, w / angle));
}

}  // namespace

Eigen::Matrix<double, 2, 3> ProjectionJacobian(const Pinhole& camera, const Eigen::Vector3d& x) {
  const double iz = 1.0 / x.z();
  Eigen::Matrix<double, 2, 3> j;
  j << camera.fx * iz, 0, -camera.fx * x.x() * iz * iz, 0, camera.fy * iz, -camera.fy * x.y() * iz * iz;
  return j;
}

Rigid3 Moved(const Rigid3& pose, const Vector6d& step) {
  return {ExpRotation(step.tail<3>()) * pose.rotation, pose.translation + step.head<3>()};
}

SteppedPoses::SteppedPoses(const std::vector<Rigid3>& starts) : poses_(starts.size()) {
  for (size_t i = 0; i < starts.size(); ++i) poses_[i].start = starts[i];
  PrepareForEvaluation(true, true);
}

void SteppedPoses::SetStart(size_t i, const Rigid3& start) {
  poses_[i].start = start;
  poses_[i].step.setZero();
}

void SteppedPoses::PrepareForEvaluation(bool, bool new_evaluation_point) {
  if (!new_evaluation_point) return;
  for (Pose& pose : poses_) {
    const Rigid3 moved = Moved(pose.start, pose.step);
    pose.translation = moved.translation;
    pose.rotation = moved.rotation.toRotationMatrix();
    pose.left_jacobian = LeftJacobian(pose.step.tail<3>());
  }
}

bool ReprojectionCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> point(parameters[1]);
  const Eigen::Vector3d rotated = pose_->rotation * point;
  const Eigen::Vector3d x = rotated + pose_->translation;
  Eigen::Map<Eigen::Vector2d> r(residuals);
  const bool behind = x.z() < kMinDepth;
  if (behind) {
    r.setConstant(kResidualBehindCamera);
  } else {
    r = (camera_->Project(x) - pixel_) * inverse_sigma_;
  }
  if (jacobians == nullptr) return true;
  using PoseJacobian = Eigen::Matrix<double, 2, 6, Eigen::RowMajor>;
  using PointJacobian = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
  Eigen::Matrix<double, 2, 3> projection = Eigen::Matrix<double, 2, 3>::Zero();
  if (!behind) projection = ProjectionJacobian(*camera_, x) * inverse_sigma_;
  if (jacobians[0] != nullptr) {
    Eigen::Map<PoseJacobian> j(jacobians[0]);
    j.leftCols<3>() = projection;
    // -projection [rotated]x, row by row a cross product.
    Eigen::Matrix<double, 2, 3> turned;
    turned.row(0) = rotated.cross(projection.row(0).transpose()).transpose();
    turned.row(1) = rotated.cross(projection.row(1).transpose()).transpose();
    j.rightCols<3>().noalias() = turned.lazyProduct(pose_->left_jacobian);
  }
  if (jacobians[1] != nullptr)
    Eigen::Map<PointJacobian>{jacobians[1]}.noalias() = projection.lazyProduct(pose_->rotation);
  return true;
}

bool RollingShutterCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  if (!at_once_.Evaluate(parameters, residuals, jacobians)) return false;
  Eigen::Map<Eigen::Vector2d> r(residuals);
  r -= parameters[2][0] * scaled_correction_;
  if (jacobians && jacobians[2]) Eigen::Vector2d::Map(jacobians[2]) = -scaled_correction_;
  return true;
}

}  // namespace mapmend
