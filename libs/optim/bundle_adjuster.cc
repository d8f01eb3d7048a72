#include "libs/optim/bundle_adjuster.h"

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <deque>

#include "libs/optim/bundle_points.h"
#include "libs/optim/position_prior.h"
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

// One call of Adjust: the problem in Ceres's terms, over the blocks that are kept.
class BundleAdjuster::Window {
 public:
  Window(const BundleOptions& options, Kept* kept, BundleProblem* problem, const std::vector<PositionPrior>* positions);

  BundleSummary Solve();
  // What Solve has found goes into the problem; points that were left out are fitted to it.
  void TakeOver();

 private:
  static ceres::Problem::Options ProblemOptions(Kept* kept);
  ceres::Solver::Options SolverOptions() const;
  void ChoosePoints();
  void AddPoints();
  void AddPoses();
  void AddReadouts();
  void AddObservations();
  void AddPositions(const std::vector<PositionPrior>& positions);

  const BundleOptions& options_;
  Kept& kept_;
  BundleProblem* problem_;
  const ObservationsByPoint by_point_;
  std::vector<uint8_t> chosen_, pose_used_, point_used_;
  int num_free_poses_ = 0;
  std::vector<double> readouts_;
  ceres::HuberLoss loss_;
  ReadoutPrior pull_;
  ceres::CauchyLoss position_loss_{kPositionCauchy};
  std::deque<PositionCost> position_costs_;
  std::deque<RollingShutterCost> rolling_costs_;
  ceres::Problem ceres_problem_;
};

BundleAdjuster::Window::Window(const BundleOptions& options, Kept* kept, BundleProblem* problem,
                               const std::vector<PositionPrior>* positions)
    : options_(options),
      kept_(*kept),
      problem_(problem),
      by_point_(*problem),
      chosen_(problem->points.size(), 1),
      pose_used_(problem->poses.size(), 0),
      point_used_(problem->points.size(), 0),
      readouts_(problem->readouts),
      loss_(options.huber),
      pull_(options.readout_sigma),
      ceres_problem_(ProblemOptions(kept)) {
  ChoosePoints();
  AddPoints();
  AddPoses();
  AddReadouts();
  AddObservations();
  if (positions != nullptr) AddPositions(*positions);
}

ceres::Problem::Options BundleAdjuster::Window::ProblemOptions(Kept* kept) {
  ceres::Problem::Options options;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.disable_all_safety_checks = true;
  options.evaluation_callback = kept->poses.get();
  return options;
}

void BundleAdjuster::Window::ChoosePoints() {
  if (options_.points_per_pose > 0) chosen_ = ChooseBundlePoints(*problem_, by_point_, options_.points_per_pose);
  for (const BundleObservation& o : problem_->observations) {
    if (chosen_[o.point]) pose_used_[o.pose] = point_used_[o.point] = 1;
  }
}

void BundleAdjuster::Window::AddPoints() {
  for (size_t i = 0; i < kept_.points.size(); ++i) {
    double* point = kept_.points[i].data();
    const bool used = i < point_used_.size() && point_used_[i];
    kept_.SetMember(point, kPointGroup, used);
    if (!used) continue;
    kept_.points[i] = problem_->points[i];
    ceres_problem_.AddParameterBlock(point, 3);
  }
}

void BundleAdjuster::Window::AddPoses() {
  for (size_t i = 0; i < kept_.poses->Size(); ++i) {
    double* step = kept_.poses->Step(i);
    const bool used = i < pose_used_.size() && pose_used_[i];
    // Ceres itself takes fixed blocks out of the order.
    kept_.SetMember(step, kPoseGroup, used && !problem_->poses[i].fixed);
    if (!used) continue;
    kept_.poses->SetStart(i, problem_->poses[i].cam_from_world);
    ceres_problem_.AddParameterBlock(step, 6);
    if (problem_->poses[i].fixed) {
      ceres_problem_.SetParameterBlockConstant(step);
    } else {
      ++num_free_poses_;
    }
  }
}

void BundleAdjuster::Window::AddReadouts() {
  for (double& readout : readouts_) {
    ceres_problem_.AddParameterBlock(&readout, 1);
    ceres_problem_.AddResidualBlock(&pull_, nullptr, &readout);
    kept_.ordering->AddElementToGroup(&readout, kReadoutGroup);
  }
}

void BundleAdjuster::Window::AddObservations() {
  kept_.num_costs = 0;
  for (size_t i = 0; i < problem_->observations.size(); ++i) {
    const BundleObservation& o = problem_->observations[i];
    if (!chosen_[o.point]) continue;
    double *step = kept_.poses->Step(o.pose), *point = kept_.points[o.point].data();
    if (readouts_.empty()) {
      ceres_problem_.AddResidualBlock(kept_.NextCost(*problem_, o), &loss_, step, point);
      continue;
    }
    const int camera = problem_->poses[o.pose].camera;
    rolling_costs_.emplace_back(problem_->cameras[camera], kept_.poses->At(o.pose), o.pixel, o.sigma,
                                problem_->shutter_correction[i].cast<double>());
    ceres_problem_.AddResidualBlock(&rolling_costs_.back(), &loss_, step, point,
                                    &readouts_[problem_->readout_of_camera[camera]]);
  }
}

void BundleAdjuster::Window::AddPositions(const std::vector<PositionPrior>& positions) {
  for (const PositionPrior& prior : positions) {
    if (!pose_used_[prior.pose]) continue;
    position_costs_.emplace_back(kept_.poses->At(prior.pose), prior);
    ceres_problem_.AddResidualBlock(&position_costs_.back(), &position_loss_, kept_.poses->Step(prior.pose));
  }
}

ceres::Solver::Options BundleAdjuster::Window::SolverOptions() const {
  ceres::Solver::Options solver;
  solver.linear_solver_type = num_free_poses_ <= kMaxDensePoses ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  solver.linear_solver_ordering = kept_.ordering;
  solver.max_num_iterations = options_.max_iterations;
  solver.function_tolerance = options_.function_tolerance;
  solver.initial_trust_region_radius = options_.initial_trust_radius;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  if (options_.max_seconds > 0) solver.max_solver_time_in_seconds = options_.max_seconds;
  return solver;
}

BundleSummary BundleAdjuster::Window::Solve() {
  kept_.poses->PrepareForEvaluation(true, true);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(), &ceres_problem_, &summary);
  for (double& readout : readouts_) kept_.ordering->Remove(&readout);
  BundleSummary result;
  result.iterations = static_cast<int>(summary.iterations.size());
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  result.success = summary.IsSolutionUsable();
  return result;
}

void BundleAdjuster::Window::TakeOver() {
  problem_->readouts = readouts_;
  for (size_t i = 0; i < pose_used_.size(); ++i) {
    if (pose_used_[i] && !problem_->poses[i].fixed) problem_->poses[i].cam_from_world = kept_.poses->Result(i);
  }
  for (size_t i = 0; i < point_used_.size(); ++i) {
    if (point_used_[i]) problem_->points[i] = kept_.points[i];
  }
  if (options_.points_per_pose > 0) RefineOthers(options_, chosen_, by_point_, problem_);
}

BundleSummary BundleAdjuster::Adjust(const BundleOptions& options, BundleProblem* problem,
                                     const std::vector<PositionPrior>* positions) {
  if (problem->observations.empty()) return {};
  kept_->MakeRoom(problem->poses.size(), problem->points.size());
  Window window(options, kept_.get(), problem, positions);
  const BundleSummary result = window.Solve();
  if (result.success) window.TakeOver();
  return result;
}

}  // namespace mapmend
