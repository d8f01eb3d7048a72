#pragma once

#include <ceres/sized_cost_function.h>

#include <array>

#include "libs/geometry/camera.h"
#include "libs/optim/reprojection_cost.h"

namespace mapmend {

// What calibration looks for: a factor of both focal lengths, then k1 k2 p1 p2 of the radial-tangential model.
inline constexpr int kNumIntrinsics = 5;
using Intrinsics = std::array<double, kNumIntrinsics>;

// The camera with these in the place of its own. Principal point, k3 and the ratio of the focal lengths stay.
Camera WithIntrinsics(const Camera& camera, const Intrinsics& intrinsics);
// Of the camera itself: factor 1.
Intrinsics IntrinsicsOf(const Camera& camera);

// Residual (project(cam_from_world * point) - pixel) / sigma with a distorted pixel; parameters: step of the pose (6),
// point (3), intrinsics (5). Behind the camera the residual is constant and has no gradient.
class CalibrationCost : public ceres::SizedCostFunction<2, 6, 3, kNumIntrinsics> {
 public:
  // camera (pinhole model) and pose must outlive it.
  CalibrationCost(const Camera& camera, const SteppedPoses::Pose& pose, const Eigen::Vector2d& pixel, double sigma)
      : camera_(&camera), pose_(&pose), pixel_(pixel), inverse_sigma_(1.0 / sigma) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const Camera* camera_;
  const SteppedPoses::Pose* pose_;
  Eigen::Vector2d pixel_;
  double inverse_sigma_;
};

}  // namespace mapmend
