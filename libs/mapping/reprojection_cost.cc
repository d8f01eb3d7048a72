#include "libs/mapping/reprojection_cost.h"

namespace mapmend {
namespace {

constexpr double kMinDepth = 1e-6;
constexpr double kResidualBehindCamera = 1e3;

Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  if (angle < 1e-12) return Eigen::Quaterniond(1, w.x() / 2, w.y() / 2, w.z() / 2).normalized();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, w / angle));
}

}  // namespace

Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Eigen::Matrix<double, 2, 3> ProjectionJacobian(const Pinhole& camera, const Eigen::Vector3d& x) {
  const double iz = 1.0 / x.z();
  Eigen::Matrix<double, 2, 3> j;
  j << camera.fx * iz, 0, -camera.fx * x.x() * iz * iz, 0, camera.fy * iz, -camera.fy * x.y() * iz * iz;
  return j;
}

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const Eigen::Map<const Eigen::Quaterniond> q(x + 3);
  const Eigen::Quaterniond turned = (ExpRotation({delta[3], delta[4], delta[5]}) * q).normalized();
  for (int i = 0; i < 3; ++i) x_plus_delta[i] = x[i] + delta[i];
  Eigen::Map<Eigen::Quaterniond>(x_plus_delta + 3) = turned;
  return true;
}

bool PoseManifold::PlusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>>(jacobian).setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  const Eigen::Map<const Eigen::Quaterniond> qy(y + 3), qx(x + 3);
  const Eigen::AngleAxisd turn(qy * qx.conjugate());
  const Eigen::Vector3d w = turn.angle() * turn.axis();
  for (int i = 0; i < 3; ++i) {
    y_minus_x[i] = y[i] - x[i];
    y_minus_x[3 + i] = w[i];
  }
  return true;
}

bool PoseManifold::MinusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>>(jacobian).setIdentity();
  return true;
}

bool ReprojectionCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> t(parameters[0]);
  const Eigen::Map<const Eigen::Quaterniond> q(parameters[0] + 3);
  const Eigen::Map<const Eigen::Vector3d> point(parameters[1]);
  const Eigen::Matrix3d R = q.toRotationMatrix();
  const Eigen::Vector3d rotated = R * point;
  const Eigen::Vector3d x = rotated + t;
  Eigen::Map<Eigen::Vector2d> r(residuals);
  const bool behind = x.z() < kMinDepth;
  if (behind) {
    r.setConstant(kResidualBehindCamera);
  } else {
    r = (camera_.Project(x) - pixel_) * inverse_sigma_;
  }
  if (jacobians == nullptr) return true;
  using PoseJacobian = Eigen::Matrix<double, 2, 7, Eigen::RowMajor>;
  using PointJacobian = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
  Eigen::Matrix<double, 2, 3> projection = Eigen::Matrix<double, 2, 3>::Zero();
  if (!behind) projection = ProjectionJacobian(camera_, x) * inverse_sigma_;
  if (jacobians[0] != nullptr) {
    Eigen::Map<PoseJacobian> j(jacobians[0]);
    j.leftCols<3>() = projection;
    j.middleCols<3>(3) = -projection * Skew(rotated);
    j.col(6).setZero();
  }
  if (jacobians[1] != nullptr) Eigen::Map<PointJacobian>{jacobians[1]} = projection * R;
  return true;
}

}  // namespace mapmend
