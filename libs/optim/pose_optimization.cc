#include "libs/optim/pose_optimization.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "libs/geometry/skew.h"
#include "libs/optim/bundle_adjustment.h"
#include "libs/optim/reprojection_cost.h"

namespace mapmend {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr int kMinInliers = 6;
constexpr double kMinDecrease = 1e-6;  // of the cost, or no further step is made

double HuberCost(double chi2, double delta) {
  if (delta <= 0 || chi2 <= delta * delta) return chi2;
  return 2 * delta * std::sqrt(chi2) - delta * delta;
}

struct System {
  Matrix6 hessian = Matrix6::Zero();
  Vector6d gradient = Vector6d::Zero();
  double cost = 0;
};

// Normal equations in the (dt, dw) of Moved. delta <= 0: no robust loss.
System Linearize(const Pinhole& camera, const Rigid3& pose, const std::vector<PoseObservation>& observations,
                 const std::vector<uint8_t>& use, double delta) {
  System system;
  const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
  for (size_t i = 0; i < observations.size(); ++i) {
    if (!use[i]) continue;
    const PoseObservation& o = observations[i];
    const Eigen::Vector3d rotated = R * o.point;
    const Eigen::Vector3d x = rotated + pose.translation;
    if (x.z() < 1e-6) continue;
    const double inverse_sigma = 1.0 / o.sigma;
    const Eigen::Vector2d r = (camera.Project(x) - o.pixel) * inverse_sigma;
    const double chi2 = r.squaredNorm();
    double weight = 1.0;
    if (delta > 0 && chi2 > delta * delta) weight = delta / std::sqrt(chi2);
    const Eigen::Matrix<double, 2, 3> projection = ProjectionJacobian(camera, x) * inverse_sigma;
    Eigen::Matrix<double, 2, 6> j;
    j.leftCols<3>() = projection;
    j.rightCols<3>() = -projection * Skew(rotated);
    system.hessian.noalias() += weight * j.transpose() * j;
    system.gradient.noalias() += weight * j.transpose() * r;
    system.cost += HuberCost(chi2, delta);
  }
  return system;
}

double Cost(const Pinhole& camera, const Rigid3& pose, const std::vector<PoseObservation>& observations,
            const std::vector<uint8_t>& use, double delta) {
  double cost = 0;
  const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
  for (size_t i = 0; i < observations.size(); ++i) {
    if (!use[i]) continue;
    const Eigen::Vector3d x = R * observations[i].point + pose.translation;
    if (x.z() < 1e-6) return std::numeric_limits<double>::infinity();
    cost += HuberCost(
        (camera.Project(x) - observations[i].pixel).squaredNorm() / (observations[i].sigma * observations[i].sigma),
        delta);
  }
  return cost;
}

}  // namespace

PoseOptimizationResult OptimizePose(const Pinhole& camera, const Rigid3& initial_cam_from_world,
                                    const std::vector<PoseObservation>& observations,
                                    const PoseOptimizationOptions& options) {
  PoseOptimizationResult result;
  result.cam_from_world = initial_cam_from_world;
  result.inlier.assign(observations.size(), 1);
  if (observations.size() < kMinInliers) return result;
  Rigid3 pose = initial_cam_from_world;
  std::vector<double> chi2(observations.size());
  for (int round = 0; round < options.rounds; ++round) {
    const double delta = round < options.rounds - 2 || round == 0 ? options.huber : 0;
    // A point behind the camera has no gradient and would block every step.
    std::vector<uint8_t> use = result.inlier;
    for (size_t i = 0; i < observations.size(); ++i) {
      if ((pose * observations[i].point).z() < 1e-6) use[i] = 0;
    }
    double lambda = 1e-4;
    for (int iteration = 0; iteration < options.iterations_per_round; ++iteration) {
      const System system = Linearize(camera, pose, observations, use, delta);
      bool improved = false;
      double decrease = 0;
      for (int attempt = 0; attempt < 5 && !improved; ++attempt) {
        Matrix6 damped = system.hessian;
        damped.diagonal() *= 1 + lambda;
        const Eigen::LDLT<Matrix6> ldlt(damped);
        if (ldlt.info() != Eigen::Success) break;
        const Vector6d step = ldlt.solve(-system.gradient);
        if (!step.allFinite()) break;
        const Rigid3 candidate = Moved(pose, step);
        const double cost = Cost(camera, candidate, observations, use, delta);
        if (cost < system.cost) {
          pose = candidate;
          lambda = std::max(1e-9, lambda / 10);
          decrease = system.cost - cost;
          improved = true;
        } else {
          lambda *= 10;
        }
      }
      if (!improved || decrease < kMinDecrease * system.cost) break;
    }
    result.num_inliers = 0;
    for (size_t i = 0; i < observations.size(); ++i) {
      chi2[i] = ReprojectionChi2(camera, pose, observations[i].point, observations[i].pixel, observations[i].sigma);
      result.inlier[i] = chi2[i] <= options.outlier_chi2;
      result.num_inliers += result.inlier[i];
    }
    if (result.num_inliers < kMinInliers) return result;
  }
  std::vector<double> of_inliers;
  for (size_t i = 0; i < chi2.size(); ++i) {
    if (result.inlier[i]) of_inliers.push_back(chi2[i]);
  }
  std::nth_element(of_inliers.begin(), of_inliers.begin() + of_inliers.size() / 2, of_inliers.end());
  result.median_chi2 = of_inliers[of_inliers.size() / 2];
  result.cam_from_world = pose;
  result.success = true;
  return result;
}

}  // namespace mapmend
