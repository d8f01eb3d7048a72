#include "libs/optim/pose_uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "libs/geometry/skew.h"
#include "libs/optim/reprojection_cost.h"

namespace mapmend {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Jacobian = Eigen::Matrix<double, 2, 6>;  // of a reprojection error, in sigma

constexpr int kLeftOut = 10;      // one in so many observations
constexpr int kCellsAcross = 80;  // of the image: what lies in one cell counts as one observation

// Per observation one over the number of those in its cell: a corner found at four octaves is off by the same error
// four times.
std::vector<double> Weights(const Pinhole& camera, const std::vector<PoseObservation>& observations) {
  const double size = static_cast<double>(camera.width) / kCellsAcross;
  std::unordered_map<int, int> count;
  std::vector<int> cells;
  for (const PoseObservation& o : observations) {
    cells.push_back(static_cast<int>(o.pixel.y() / size) * 2 * kCellsAcross + static_cast<int>(o.pixel.x() / size));
    ++count[cells.back()];
  }
  std::vector<double> weights;
  for (const int cell : cells) weights.push_back(1.0 / count[cell]);
  return weights;
}

// Takes observations off the Hessian, one after the other that with the most influence on what is left: one of two that
// agree hides the other's. False if the Hessian becomes singular.
bool LeaveOutMostInfluential(const std::vector<Jacobian>& jacobians, size_t count, Matrix6* hessian) {
  std::vector<uint8_t> left_out(jacobians.size(), 0);
  for (size_t n = 0; n <= count; ++n) {
    const Eigen::LDLT<Matrix6> solver(*hessian);
    if (solver.info() != Eigen::Success || !solver.isPositive()) return false;
    if (n == count) break;
    const Matrix6 covariance = solver.solve(Matrix6::Identity());
    size_t most = 0;
    double most_influence = -1;
    for (size_t i = 0; i < jacobians.size(); ++i) {
      if (left_out[i]) continue;
      const double influence = (jacobians[i] * covariance).cwiseProduct(jacobians[i]).sum();
      if (influence > most_influence) most = i, most_influence = influence;
    }
    left_out[most] = 1;
    *hessian -= jacobians[most].transpose() * jacobians[most];
  }
  return true;
}

}  // namespace

double RelativePositionSigma(const Pinhole& camera, const Rigid3& cam_from_world,
                             const std::vector<PoseObservation>& observations) {
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  if (observations.size() < 4) return kUnknown;
  std::vector<Jacobian> jacobians;
  std::vector<double> depths;
  Matrix6 hessian = Matrix6::Zero();
  const std::vector<double> weights = Weights(camera, observations);
  for (size_t i = 0; i < observations.size(); ++i) {
    const PoseObservation& o = observations[i];
    const Eigen::Vector3d x = cam_from_world * o.point;
    const Eigen::Matrix<double, 2, 3> projection = std::sqrt(weights[i]) / o.sigma * ProjectionJacobian(camera, x);
    Jacobian j;
    j << projection, -projection * Skew(x);  // of a step of the camera in its own frame: translation, rotation
    jacobians.push_back(j);
    hessian += jacobians.back().transpose() * jacobians.back();
    depths.push_back(x.z());
  }
  if (!LeaveOutMostInfluential(jacobians, observations.size() / kLeftOut, &hessian)) return kUnknown;
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
