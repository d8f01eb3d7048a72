#include "libs/optim/position_prior.h"

#include "libs/geometry/skew.h"

namespace mapmend {

bool PositionCost::Evaluate(double const* const*, double* residuals, double** jacobians) const {
  const Eigen::Matrix3d inverse = pose_->rotation.transpose();
  Eigen::Map<Eigen::Vector3d> r(residuals);
  r = prior_->whitening * (-(inverse * pose_->translation) - prior_->position);
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;
  Eigen::Map<Eigen::Matrix<double, 3, 6, Eigen::RowMajor>> j(jacobians[0]);
  j.leftCols<3>() = -prior_->whitening * inverse;
  j.rightCols<3>() = -prior_->whitening * inverse * Skew(pose_->translation) * pose_->left_jacobian;
  return true;
}

}  // namespace mapmend
