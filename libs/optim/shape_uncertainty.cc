#include "libs/optim/shape_uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <vector>

#include "libs/optim/reprojection_cost.h"

namespace mapmend {
namespace {

constexpr int kCellsAcross = 80;  // of the image: what lies in one cell counts as one observation
constexpr double kUnknown = std::numeric_limits<double>::infinity();

// Derivatives of one error, in sigma: by the centre and the rotation of its camera, and by its point.
struct Linearised {
  int pose = -1;
  Eigen::Matrix<double, 2, 6> by_pose;
  Eigen::Matrix<double, 2, 3> by_point;
};

int Cell(const Pinhole& camera, const Eigen::Vector2d& pixel) {
  const double size = static_cast<double>(camera.width) / kCellsAcross;
  return static_cast<int>(pixel.y() / size) * 2 * kCellsAcross + static_cast<int>(pixel.x() / size);
}

// By point.
std::vector<std::vector<Linearised>> Linearise(const BundleProblem& problem, double max_chi2) {
  std::map<std::pair<int, int>, int> in_cell;  // by pose and cell
  std::vector<const BundleObservation*> used;
  for (const BundleObservation& o : problem.observations) {
    const BundlePose& pose = problem.poses[o.pose];
    const Pinhole& camera = problem.cameras[pose.camera];
    if (!(ReprojectionChi2(camera, pose.cam_from_world, problem.points[o.point], o.pixel, o.sigma) <= max_chi2))
      continue;
    used.push_back(&o);
    ++in_cell[{o.pose, Cell(camera, o.pixel)}];
  }
  std::vector<std::vector<Linearised>> result(problem.points.size());
  for (const BundleObservation* o : used) {
    const BundlePose& pose = problem.poses[o->pose];
    const Pinhole& camera = problem.cameras[pose.camera];
    const double weight = 1 / (o->sigma * std::sqrt(in_cell[{o->pose, Cell(camera, o->pixel)}]));
    const Eigen::Vector3d x = pose.cam_from_world * problem.points[o->point];
    const Eigen::Matrix<double, 2, 3> projection = weight * ProjectionJacobian(camera, x);
    Linearised linearised;
    linearised.pose = o->pose;
    linearised.by_point = projection * pose.cam_from_world.rotation.toRotationMatrix();
    linearised.by_pose << -linearised.by_point, -projection * Skew(x);
    result[o->point].push_back(linearised);
  }
  return result;
}

// The Hessian by centres and rotations of all poses but the first, with the points eliminated.
Eigen::MatrixXd ReducedHessian(const BundleProblem& problem, double max_chi2) {
  const auto size = static_cast<Eigen::Index>(6 * (problem.poses.size() - 1));
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(size, size);
  const auto at = [](int pose) { return static_cast<Eigen::Index>(6 * (pose - 1)); };
  for (const std::vector<Linearised>& of_point : Linearise(problem, max_chi2)) {
    if (of_point.size() < 2) continue;
    Eigen::Matrix3d by_point = Eigen::Matrix3d::Zero();
    for (const Linearised& o : of_point) by_point += o.by_point.transpose() * o.by_point;
    // A point without depth still has a direction: it is held where it is by a millionth of what is known of it.
    by_point.diagonal().array() += 1e-9 * by_point.trace();
    const Eigen::Matrix3d inverse = by_point.inverse();
    for (const Linearised& a : of_point) {
      if (a.pose == 0) continue;
      hessian.block<6, 6>(at(a.pose), at(a.pose)) += a.by_pose.transpose() * a.by_pose;
      const Eigen::Matrix<double, 6, 3> mixed = a.by_pose.transpose() * a.by_point * inverse;
      for (const Linearised& b : of_point) {
        if (b.pose == 0) continue;
        hessian.block<6, 6>(at(a.pose), at(b.pose)) -= mixed * (b.by_point.transpose() * b.by_pose);
      }
    }
  }
  return hessian;
}

}  // namespace

double RelativeShapeSigma(const BundleProblem& problem, double max_chi2) {
  const size_t num_poses = problem.poses.size();
  if (num_poses < 2) return kUnknown;
  Eigen::MatrixXd hessian = ReducedHessian(problem, max_chi2);
  // All centres moved away from the first one: a change of scale, of which the images say nothing.
  Eigen::VectorXd scaling = Eigen::VectorXd::Zero(hessian.rows());
  const Eigen::Vector3d first = problem.poses[0].cam_from_world.Center();
  for (size_t i = 1; i < num_poses; ++i)
    scaling.segment<3>(static_cast<Eigen::Index>(6 * (i - 1))) = problem.poses[i].cam_from_world.Center() - first;
  const double extent = scaling.norm();
  if (!(extent > 0)) return kUnknown;
  scaling /= extent;
  const double held = hessian.trace() / static_cast<double>(hessian.rows());
  if (!(held > 0)) return kUnknown;
  hessian += held * scaling * scaling.transpose();
  const Eigen::LDLT<Eigen::MatrixXd> solver(hessian);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return kUnknown;
  const Eigen::MatrixXd covariance = solver.solve(Eigen::MatrixXd::Identity(hessian.rows(), hessian.cols()));
  double variance = -1 / held;  // what was held has to be taken off again
  for (size_t i = 1; i < num_poses; ++i)
    variance += covariance.diagonal().segment<3>(static_cast<Eigen::Index>(6 * (i - 1))).sum();
  if (!std::isfinite(variance)) return kUnknown;
  return std::sqrt(std::max(0.0, variance)) / extent;
}

}  // namespace mapmend
