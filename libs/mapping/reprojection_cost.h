#pragma once

#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"

// The one residual of bundle adjustment, and the manifold of its poses.
namespace mapmend {

Eigen::Matrix3d Skew(const Eigen::Vector3d& v);

// d pixel / d x_cam of a pinhole camera, 2x3.
Eigen::Matrix<double, 2, 3> ProjectionJacobian(const Pinhole& camera, const Eigen::Vector3d& x_cam);

// A rigid pose as 7 numbers (tx ty tz qx qy qz qw) with 6 degrees of freedom (dt, dw): t' = t + dt, R' = exp(dw) R.
// Cost functions on it give their Jacobian with respect to (dt, dw) in the first six columns and zero in the seventh, so
// that PlusJacobian is constant.
class PoseManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

// Residual (project(cam_from_world * point) - pixel) / sigma; parameters: pose (7), point (3).
// Behind the camera (z < 1e-6 of a unit) the residual is constant and has no gradient.
class ReprojectionCost : public ceres::SizedCostFunction<2, 7, 3> {
 public:
  ReprojectionCost(const Pinhole& camera, const Eigen::Vector2d& pixel, double sigma)
      : camera_(camera), pixel_(pixel), inverse_sigma_(1.0 / sigma) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const Pinhole& camera_;
  Eigen::Vector2d pixel_;
  double inverse_sigma_;
};

}  // namespace mapmend
