#include "libs/mapping/bundle_adjustment.h"

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <array>
#include <deque>
#include <limits>
#include <memory>

#include "libs/mapping/reprojection_cost.h"

namespace mapmend {

BundleSummary AdjustBundle(const BundleOptions& options, BundleProblem* problem) {
  BundleSummary result;
  if (problem->observations.empty()) return result;

  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.disable_all_safety_checks = true;
  ceres::HuberLoss loss(options.huber);
  PoseManifold manifold;
  ceres::Problem ceres_problem(problem_options);

  std::vector<std::array<double, 7>> poses;
  poses.reserve(problem->poses.size());
  for (const BundlePose& pose : problem->poses) poses.push_back(ToArray(pose.cam_from_world));
  std::vector<Eigen::Vector3d> points = problem->points;
  std::deque<ReprojectionCost> costs;  // Ceres cost functions cannot be moved

  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  std::vector<uint8_t> pose_used(poses.size(), 0), point_used(points.size(), 0);
  for (const BundleObservation& o : problem->observations) pose_used[o.pose] = point_used[o.point] = 1;
  for (size_t i = 0; i < points.size(); ++i) {
    if (!point_used[i]) continue;
    ceres_problem.AddParameterBlock(points[i].data(), 3);
    ordering->AddElementToGroup(points[i].data(), 0);
  }
  int num_free_poses = 0;
  for (size_t i = 0; i < poses.size(); ++i) {
    if (!pose_used[i]) continue;
    ceres_problem.AddParameterBlock(poses[i].data(), 7, &manifold);
    ordering->AddElementToGroup(poses[i].data(), 1);
    if (problem->poses[i].fixed) {
      ceres_problem.SetParameterBlockConstant(poses[i].data());
    } else {
      ++num_free_poses;
    }
  }
  for (const BundleObservation& o : problem->observations) {
    costs.emplace_back(problem->cameras[problem->poses[o.pose].camera], o.pixel, o.sigma);
    ceres_problem.AddResidualBlock(&costs.back(), &loss, poses[o.pose].data(), points[o.point].data());
  }

  ceres::Solver::Options solver_options;
  solver_options.linear_solver_type = num_free_poses <= 60 ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  solver_options.linear_solver_ordering = ordering;
  solver_options.max_num_iterations = options.max_iterations;
  solver_options.function_tolerance = options.function_tolerance;
  solver_options.num_threads = 1;
  solver_options.logging_type = ceres::SILENT;
  if (options.max_seconds > 0) solver_options.max_solver_time_in_seconds = options.max_seconds;
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &ceres_problem, &summary);

  result.iterations = static_cast<int>(summary.iterations.size());
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  result.success = summary.IsSolutionUsable();
  if (!result.success) return result;
  for (size_t i = 0; i < poses.size(); ++i) {
    if (!problem->poses[i].fixed) problem->poses[i].cam_from_world = RigidFromArray(poses[i].data());
  }
  problem->points = std::move(points);
  return result;
}

double ReprojectionChi2(const Pinhole& camera, const Rigid3& cam_from_world, const Eigen::Vector3d& point,
                        const Eigen::Vector2d& pixel, double sigma) {
  const Eigen::Vector3d x = cam_from_world * point;
  if (!(x.z() > 1e-6)) return std::numeric_limits<double>::infinity();
  return (camera.Project(x) - pixel).squaredNorm() / (sigma * sigma);
}

}  // namespace mapmend
