#include "libs/optim/bundle_points.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "libs/optim/behind_camera.h"
#include "libs/optim/reprojection_cost.h"

namespace mapmend {
namespace {

constexpr int kColumns = 8, kRows = 6;  // of cells of an image
constexpr int kMaxIterations = 3;
constexpr double kMinPointDecrease = 1e-3;  // of the cost, or no further step is made

int CellOf(const BundleProblem& problem, const BundleObservation& o) {
  const Pinhole& camera = problem.cameras[problem.poses[o.pose].camera];
  const int x = std::clamp(static_cast<int>(o.pixel.x() * kColumns / camera.width), 0, kColumns - 1);
  const int y = std::clamp(static_cast<int>(o.pixel.y() * kRows / camera.height), 0, kRows - 1);
  return (o.pose * kRows + y) * kColumns + x;
}

struct PointSystem {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double cost = 0;
};

PointSystem Linearize(const BundleProblem& problem, const std::vector<Eigen::Matrix3d>& rotations,
                      std::span<const int> observations, double huber, const Eigen::Vector3d& point) {
  PointSystem system;
  for (const int i : observations) {
    const BundleObservation& o = problem.observations[i];
    const BundlePose& pose = problem.poses[o.pose];
    const Pinhole& camera = problem.cameras[pose.camera];
    const Eigen::Vector3d x = rotations[o.pose] * point + pose.cam_from_world.translation;
    if (x.z() < kMinDepth) {
      system.cost = std::numeric_limits<double>::infinity();
      return system;
    }
    const double inverse_sigma = 1 / o.sigma;
    const Eigen::Vector2d r = (camera.Project(x) - o.pixel) * inverse_sigma;
    const double norm = r.norm(), weight = norm <= huber ? 1 : huber / norm;
    system.cost += norm <= huber ? norm * norm : 2 * huber * norm - huber * huber;
    const Eigen::Matrix<double, 2, 3> J =
        (ProjectionJacobian(camera, x) * inverse_sigma).lazyProduct(rotations[o.pose]);
    system.hessian.noalias() += weight * J.transpose().lazyProduct(J);
    system.gradient.noalias() += weight * J.transpose().lazyProduct(r);
  }
  return system;
}

}  // namespace

std::vector<uint8_t> ChooseBundlePoints(const BundleProblem& problem, const ObservationsByPoint& by_point,
                                        int per_pose) {
  const int per_cell = (per_pose + kColumns * kRows - 1) / (kColumns * kRows);
  std::vector<int> order(problem.points.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int l, int r) { return by_point.Of(l).size() > by_point.Of(r).size(); });
  std::vector<int> held(problem.poses.size() * kColumns * kRows, 0);  // chosen points of each cell
  std::vector<uint8_t> chosen(problem.points.size(), 0);
  for (const int p : order) {
    for (const int i : by_point.Of(p)) {
      const BundleObservation& o = problem.observations[i];
      if (!problem.poses[o.pose].fixed && held[CellOf(problem, o)] < per_cell) {
        chosen[p] = 1;
        break;
      }
    }
    if (!chosen[p]) continue;
    for (const int i : by_point.Of(p)) ++held[CellOf(problem, problem.observations[i])];
  }
  return chosen;
}

ObservationsByPoint::ObservationsByPoint(const BundleProblem& problem)
    : first(problem.points.size() + 1, 0), indices(problem.observations.size()) {
  for (const BundleObservation& o : problem.observations) ++first[o.point + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<int> next(first.begin(), first.end() - 1);
  for (size_t i = 0; i < indices.size(); ++i) indices[next[problem.observations[i].point]++] = static_cast<int>(i);
}

void RefineBundlePoint(const BundleProblem& problem, const std::vector<Eigen::Matrix3d>& rotations,
                       std::span<const int> observations, double huber, Eigen::Vector3d* point) {
  PointSystem system = Linearize(problem, rotations, observations, huber, *point);
  for (int iteration = 0; iteration < kMaxIterations && std::isfinite(system.cost); ++iteration) {
    Eigen::Matrix3d damped = system.hessian;
    damped.diagonal() *= 1 + 1e-6;
    const Eigen::Vector3d next = *point - damped.llt().solve(system.gradient);
    if (!next.allFinite()) return;
    const PointSystem next_system = Linearize(problem, rotations, observations, huber, next);
    if (!(next_system.cost < system.cost)) return;
    *point = next;
    const bool done = system.cost - next_system.cost < kMinPointDecrease * system.cost;
    system = next_system;
    if (done) return;
  }
}

}  // namespace mapmend
