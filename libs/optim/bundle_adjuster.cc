#include "libs/optim/bundle_adjuster.h"

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <deque>

#include "libs/optim/bundle_points.h"
#include "libs/optim/reprojection_cost.h"

namespace mapmend {
namespace {

// The order of elimination. Within a group Ceres goes by address: each group lies in one array, in order of index.
constexpr int kPointGroup = 0, kPoseGroup = 1, kReadoutGroup = 2;
constexpr int kMaxDensePoses = 60;

class ReadoutPrior : public ceres::SizedCostFunction<1, 1> {
 public:
  explicit ReadoutPrior(double sigma) : inverse_sigma_(1 / sigma) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    residuals[0] = inverse_sigma_ * parameters[0][0];
    if (jacobians && jacobians[0]) jacobians[0][0] = inverse_sigma_;
    return true;
  }

 private:
  double inverse_sigma_;
};

void RefineOthers(const BundleOptions& options, const std::vector<uint8_t>& chosen, const ObservationsByPoint& by_point,
                  BundleProblem* problem) {
  std::vector<Eigen::Matrix3d> rotations;
  for (const BundlePose& pose : problem->poses) rotations.push_back(pose.cam_from_world.rotation.toRotationMatrix());
  for (size_t p = 0; p < chosen.size(); ++p) {
    if (!chosen[p]) RefineBundlePoint(*problem, rotations, by_point.Of(p), options.huber, &problem->points[p]);
  }
}

}  // namespace

// What Ceres's blocks point to: the pose or point of each index has its place, wherever the window is.
struct BundleAdjuster::Kept {
  // Room for so many; nothing is moved unless it does not suffice.
  void MakeRoom(size_t num_poses, size_t num_points);
  void SetMember(double* block, int group, bool member);
  ReprojectionCost* NextCost(const BundleProblem& problem, const BundleObservation& o);

  std::unique_ptr<SteppedPoses> poses;
  std::vector<Eigen::Vector3d> points;
  std::deque<ReprojectionCost> costs;                       // Ceres cost functions cannot be moved
  size_t num_costs = 0;                                     // in use
  std::shared_ptr<ceres::ParameterBlockOrdering> ordering;  // blocks of the window before
};

void BundleAdjuster::Kept::MakeRoom(size_t num_poses, size_t num_points) {
  if (poses && poses->Size() >= num_poses && points.size() >= num_points) return;
  poses = std::make_unique<SteppedPoses>(num_poses);
  points.resize(num_points);
  ordering = std::make_shared<ceres::ParameterBlockOrdering>();
}

void BundleAdjuster::Kept::SetMember(double* block, int group, bool member) {
  const bool is_member = ordering->IsMember(block);
  if (member && !is_member) ordering->AddElementToGroup(block, group);
  if (!member && is_member) ordering->Remove(block);
}

ReprojectionCost* BundleAdjuster::Kept::NextCost(const BundleProblem& problem, const BundleObservation& o) {
  const Pinhole& camera = problem.cameras[problem.poses[o.pose].camera];
  const SteppedPoses::Pose& pose = poses->At(o.pose);
  if (num_costs == costs.size()) {
    costs.emplace_back(camera, pose, o.pixel, o.sigma);
  } else {
    costs[num_costs].Set(camera, pose, o.pixel, o.sigma);
  }
  return &costs[num_costs++];
}

BundleAdjuster::BundleAdjuster() : kept_(std::make_unique<Kept>()) {}
BundleAdjuster::~BundleAdjuster() = default;
BundleAdjuster::BundleAdjuster(BundleAdjuster&&) noexcept = default;
BundleAdjuster& BundleAdjuster::operator=(BundleAdjuster&&) noexcept = default;

BundleSummary BundleAdjuster::Adjust(const BundleOptions& options, BundleProblem* problem) {
  BundleSummary result;
  if (problem->observations.empty()) return result;
  const ObservationsByPoint by_point(*problem);
  std::vector<uint8_t> chosen(problem->points.size(), 1);
  if (options.points_per_pose > 0) chosen = ChooseBundlePoints(*problem, by_point, options.points_per_pose);
  std::vector<uint8_t> pose_used(problem->poses.size(), 0), point_used(problem->points.size(), 0);
  for (const BundleObservation& o : problem->observations) {
    if (chosen[o.point]) pose_used[o.pose] = point_used[o.point] = 1;
  }

  Kept& kept = *kept_;
  kept.MakeRoom(problem->poses.size(), problem->points.size());
  ceres::HuberLoss loss(options.huber);
  ReadoutPrior pull(options.readout_sigma);
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.disable_all_safety_checks = true;
  problem_options.evaluation_callback = kept.poses.get();
  ceres::Problem ceres_problem(problem_options);
  for (size_t i = 0; i < kept.points.size(); ++i) {
    double* point = kept.points[i].data();
    const bool used = i < point_used.size() && point_used[i];
    kept.SetMember(point, kPointGroup, used);
    if (!used) continue;
    kept.points[i] = problem->points[i];
    ceres_problem.AddParameterBlock(point, 3);
  }
  int num_free_poses = 0;
  for (size_t i = 0; i < kept.poses->Size(); ++i) {
    double* step = kept.poses->Step(i);
    const bool used = i < pose_used.size() && pose_used[i];
    // Ceres itself takes fixed blocks out of the order.
    kept.SetMember(step, kPoseGroup, used && !problem->poses[i].fixed);
    if (!used) continue;
    kept.poses->SetStart(i, problem->poses[i].cam_from_world);
    ceres_problem.AddParameterBlock(step, 6);
    if (problem->poses[i].fixed) {
      ceres_problem.SetParameterBlockConstant(step);
    } else {
      ++num_free_poses;
    }
  }
  kept.num_costs = 0;
  std::deque<RollingShutterCost> rolling_costs;
  std::vector<double> readouts = problem->readouts;
  for (double& readout : readouts) {
    ceres_problem.AddParameterBlock(&readout, 1);
    ceres_problem.AddResidualBlock(&pull, nullptr, &readout);
    kept.ordering->AddElementToGroup(&readout, kReadoutGroup);
  }
  for (size_t i = 0; i < problem->observations.size(); ++i) {
    const BundleObservation& o = problem->observations[i];
    if (!chosen[o.point]) continue;
    if (readouts.empty()) {
      ceres_problem.AddResidualBlock(kept.NextCost(*problem, o), &loss, kept.poses->Step(o.pose),
                                     kept.points[o.point].data());
      continue;
    }
    const int camera = problem->poses[o.pose].camera;
    rolling_costs.emplace_back(problem->cameras[camera], kept.poses->At(o.pose), o.pixel, o.sigma,
                               problem->shutter_correction[i].cast<double>());
    ceres_problem.AddResidualBlock(&rolling_costs.back(), &loss, kept.poses->Step(o.pose), kept.points[o.point].data(),
                                   &readouts[problem->readout_of_camera[camera]]);
  }
  kept.poses->PrepareForEvaluation(true, true);

  ceres::Solver::Options solver_options;
  solver_options.linear_solver_type = num_free_poses <= kMaxDensePoses ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  solver_options.linear_solver_ordering = kept.ordering;
  solver_options.max_num_iterations = options.max_iterations;
  solver_options.function_tolerance = options.function_tolerance;
  solver_options.initial_trust_region_radius = options.initial_trust_radius;
  solver_options.num_threads = 1;
  solver_options.logging_type = ceres::SILENT;
  if (options.max_seconds > 0) solver_options.max_solver_time_in_seconds = options.max_seconds;
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &ceres_problem, &summary);
  for (double& readout : readouts) kept.ordering->Remove(&readout);

  result.iterations = static_cast<int>(summary.iterations.size());
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  result.success = summary.IsSolutionUsable();
  if (!result.success) return result;
  problem->readouts = readouts;
  for (size_t i = 0; i < pose_used.size(); ++i) {
    if (pose_used[i] && !problem->poses[i].fixed) problem->poses[i].cam_from_world = kept.poses->Result(i);
  }
  for (size_t i = 0; i < point_used.size(); ++i) {
    if (point_used[i]) problem->points[i] = kept.points[i];
  }
  if (options.points_per_pose > 0) RefineOthers(options, chosen, by_point, problem);
  return result;
}

}  // namespace mapmend
