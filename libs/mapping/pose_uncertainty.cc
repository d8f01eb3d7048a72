#include "libs/mapping/pose_uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "libs/mapping/reprojection_cost.h"

namespace mapmend {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Jacobian = Eigen::Matrix<double, 2, 6>;  // of a reprojection error, in sigma

constexpr int kLeftOut = 10;  // one in so many observations

}  // namespace

double RelativePositionSigma(const Pinhole& camera, const Rigid3& cam_from_world,
                             const std::vector<PoseObservation>& observations) {
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  if (observations.size() < 4) return kUnknown;
  std::vector<Jacobian> jacobians;
  std::vector<double> depths;
  Matrix6 hessian = Matrix6::Zero();
  for (const PoseObservation& o : observations) {
    const Eigen::Vector3d x = cam_from_world * o.point;
    const Eigen::Matrix<double, 2, 3> projection = ProjectionJacobian(camera, x) / o.sigma;
    Jacobian j;
    j << projection, -projection * Skew(x);  // of a step of the camera in its own frame: translation, rotation
    jacobians.push_back(j);
    hessian += jacobians.back().transpose() * jacobians.back();
    depths.push_back(x.z());
  }
  const Eigen::LDLT<Matrix6> solver(hessian);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return kUnknown;
  std::vector<double> influence;
  for (const Jacobian& j : jacobians) influence.push_back((j * solver.solve(j.transpose())).trace());
  std::vector<int> order(observations.size());
  std::iota(order.begin(), order.end(), 0);
  const auto most_influence_first = [&](int a, int b) { return influence[a] > influence[b]; };
  const auto num_left_out = static_cast<std::ptrdiff_t>(observations.size() / kLeftOut);
  std::nth_element(order.begin(), order.begin() + num_left_out, order.end(), most_influence_first);
  for (auto i = order.begin(); i != order.begin() + num_left_out; ++i) {
    hessian -= jacobians[*i].transpose() * jacobians[*i];
  }
  // The position's information once the rotation is free to follow.
  const Eigen::Matrix3d mixed = hessian.bottomLeftCorner<3, 3>(), rotation = hessian.bottomRightCorner<3, 3>();
  const Eigen::Matrix3d information = hessian.topLeftCorner<3, 3>() - mixed.transpose() * rotation.ldlt().solve(mixed);
  const double least =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information, Eigen::EigenvaluesOnly).eigenvalues()[0];
  if (!(least > 0)) return kUnknown;
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  return 1 / (std::sqrt(least) * depths[depths.size() / 2]);
}

}  // namespace mapmend
