#include "libs/mapping/bundle_adjustment.h"

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <deque>
#include <limits>
#include <memory>

#include "libs/mapping/bundle_points.h"
#include "libs/mapping/reprojection_cost.h"

namespace mapmend {

namespace {

void RefineOthers(const BundleOptions& options, const std::vector<uint8_t>& chosen, BundleProblem* problem) {
  const ObservationsByPoint by_point(*problem);
  std::vector<Eigen::Matrix3d> rotations;
  for (const BundlePose& pose : problem->poses) rotations.push_back(pose.cam_from_world.rotation.toRotationMatrix());
  for (size_t p = 0; p < chosen.size(); ++p) {
    if (!chosen[p]) RefineBundlePoint(*problem, rotations, by_point.Of(p), options.huber, &problem->points[p]);
  }
}

}  // namespace

BundleSummary AdjustBundle(const BundleOptions& options, BundleProblem* problem) {
  BundleSummary result;
  if (problem->observations.empty()) return result;

  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.disable_all_safety_checks = true;
  ceres::HuberLoss loss(options.huber);
  std::vector<Rigid3> starts;
  starts.reserve(problem->poses.size());
  for (const BundlePose& pose : problem->poses) starts.push_back(pose.cam_from_world);
  SteppedPoses poses(starts);
  problem_options.evaluation_callback = &poses;
  ceres::Problem ceres_problem(problem_options);
  std::vector<Eigen::Vector3d> points = problem->points;
  std::deque<ReprojectionCost> costs;  // Ceres cost functions cannot be moved

  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  std::vector<uint8_t> chosen(points.size(), 1);
  if (options.points_per_pose > 0) chosen = ChooseBundlePoints(*problem, options.points_per_pose);
  std::vector<uint8_t> pose_used(starts.size(), 0), point_used(points.size(), 0);
  for (const BundleObservation& o : problem->observations) {
    if (chosen[o.point]) pose_used[o.pose] = point_used[o.point] = 1;
  }
  for (size_t i = 0; i < points.size(); ++i) {
    if (!point_used[i]) continue;
    ceres_problem.AddParameterBlock(points[i].data(), 3);
    ordering->AddElementToGroup(points[i].data(), 0);
  }
  int num_free_poses = 0;
  for (size_t i = 0; i < starts.size(); ++i) {
    if (!pose_used[i]) continue;
    ceres_problem.AddParameterBlock(poses.Step(i), 6);
    ordering->AddElementToGroup(poses.Step(i), 1);
    if (problem->poses[i].fixed) {
      ceres_problem.SetParameterBlockConstant(poses.Step(i));
    } else {
      ++num_free_poses;
    }
  }
  for (const BundleObservation& o : problem->observations) {
    if (!chosen[o.point]) continue;
    costs.emplace_back(problem->cameras[problem->poses[o.pose].camera], poses.At(o.pose), o.pixel, o.sigma);
    ceres_problem.AddResidualBlock(&costs.back(), &loss, poses.Step(o.pose), points[o.point].data());
  }

  ceres::Solver::Options solver_options;
  solver_options.linear_solver_type = num_free_poses <= 60 ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  solver_options.linear_solver_ordering = ordering;
  solver_options.max_num_iterations = options.max_iterations;
  solver_options.function_tolerance = options.function_tolerance;
  solver_options.initial_trust_region_radius = options.initial_trust_radius;
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
  for (size_t i = 0; i < starts.size(); ++i) {
    if (!problem->poses[i].fixed) problem->poses[i].cam_from_world = poses.Result(i);
  }
  problem->points = std::move(points);
  if (options.points_per_pose > 0) RefineOthers(options, chosen, problem);
  return result;
}

double ReprojectionChi2(const Pinhole& camera, const Rigid3& cam_from_world, const Eigen::Vector3d& point,
                        const Eigen::Vector2d& pixel, double sigma) {
  const Eigen::Vector3d x = cam_from_world * point;
  if (!(x.z() > 1e-6)) return std::numeric_limits<double>::infinity();
  return (camera.Project(x) - pixel).squaredNorm() / (sigma * sigma);
}

}  // namespace mapmend
