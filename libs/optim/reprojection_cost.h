#pragma once

#include <ceres/evaluation_callback.h>
#include <ceres/sized_cost_function.h>

#include <vector>

#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"

// The one residual of bundle adjustment, and the poses that it is a function of.
namespace mapmend {

using Vector6d = Eigen::Matrix<double, 6, 1>;

// d pixel / d x_cam of a pinhole camera, 2x3.
Eigen::Matrix<double, 2, 3> ProjectionJacobian(const Pinhole& camera, const Eigen::Vector3d& x_cam);

// The pose moved by (dt, dw): t' = t + dt, R' = exp(dw) R.
Rigid3 Moved(const Rigid3& pose, const Vector6d& step);

// Poses cam_from_world as Ceres moves them: pose i is its start, moved by the parameter block step(i). What all
// residuals of a pose share, its rotation matrix and derivative, is computed once per evaluation.
class SteppedPoses : public ceres::EvaluationCallback {
 public:
  struct Pose {
    Rigid3 start;
    Vector6d step = Vector6d::Zero();
    Eigen::Vector3d translation;
    Eigen::Matrix3d rotation;
    Eigen::Matrix3d left_jacobian;  // d exp(dw + e) = exp(left_jacobian e) exp(dw)
  };

  explicit SteppedPoses(size_t count) : poses_(count) {}
  explicit SteppedPoses(const std::vector<Rigid3>& starts);
  size_t Size() const { return poses_.size(); }
  // A start with no step; to be prepared for evaluation.
  void SetStart(size_t i, const Rigid3& start);
  double* Step(size_t i) { return poses_[i].step.data(); }
  const Pose& At(size_t i) const { return poses_[i]; }
  Rigid3 Result(size_t i) const { return Moved(poses_[i].start, poses_[i].step); }

  void PrepareForEvaluation(bool evaluate_jacobians, bool new_evaluation_point) override;

 private:
  std::vector<Pose> poses_;
};

// Residual (project(cam_from_world * point) - pixel) / sigma; parameters: step of the pose (6), point (3).
// Behind the camera (z < 1e-6 of a unit) the residual is constant and has no gradient.
class ReprojectionCost : public ceres::SizedCostFunction<2, 6, 3> {
 public:
  // camera and pose must outlive it.
  ReprojectionCost(const Pinhole& camera, const SteppedPoses::Pose& pose, const Eigen::Vector2d& pixel, double sigma)
      : camera_(&camera), pose_(&pose), pixel_(pixel), inverse_sigma_(1.0 / sigma) {}
  // Makes it the cost of another observation.
  void Set(const Pinhole& camera, const SteppedPoses::Pose& pose, const Eigen::Vector2d& pixel, double sigma) {
    camera_ = &camera, pose_ = &pose, pixel_ = pixel, inverse_sigma_ = 1.0 / sigma;
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const Pinhole* camera_;
  const SteppedPoses::Pose* pose_;
  Eigen::Vector2d pixel_;
  double inverse_sigma_;
};

// The same with an image read row by row: the pixel moves by correction (pixels per second) times the third parameter,
// the readout time.
class RollingShutterCost : public ceres::SizedCostFunction<2, 6, 3, 1> {
 public:
  RollingShutterCost(const Pinhole& camera, const SteppedPoses::Pose& pose, const Eigen::Vector2d& pixel, double sigma,
                     const Eigen::Vector2d& correction)
      : at_once_(camera, pose, pixel, sigma), scaled_correction_(correction / sigma) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  ReprojectionCost at_once_;
  Eigen::Vector2d scaled_correction_;
};

}  // namespace mapmend
