#pragma once

#include <ceres/sized_cost_function.h>

#include <Eigen/Core>

#include "libs/optim/reprojection_cost.h"

namespace mapmend {

// Where a receiver says that a camera was. The residual whitening * (centre - position) is in standard deviations;
// large ones lose their influence (Cauchy).
struct PositionPrior {
  int pose = -1;                                            // index into the poses, or the vertices of a pose graph
  Eigen::Vector3d position = Eigen::Vector3d::Zero();       // of the centre, world
  Eigen::Matrix3d whitening = Eigen::Matrix3d::Identity();  // square root of the information
};

// Of a pose cam_from_world; parameter: its step (6).
class PositionCost : public ceres::SizedCostFunction<3, 6> {
 public:
  // pose and prior must outlive it.
  PositionCost(const SteppedPoses::Pose& pose, const PositionPrior& prior) : pose_(&pose), prior_(&prior) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const SteppedPoses::Pose* pose_;
  const PositionPrior* prior_;
};

inline constexpr double kPositionCauchy = 3;  // standard deviations at which a position begins to lose influence

}  // namespace mapmend
