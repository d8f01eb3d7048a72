#include "libs/optim/calibration.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "libs/base/text_format.h"
#include "libs/optim/calibration_cost.h"
#include "libs/optim/calibration_covariance.h"

namespace mapmend {
namespace {

constexpr int kMaxDenseCalibrationPoses = 200;
constexpr int kMinObservations = 200, kMinPoses = 3;
constexpr double kFunctionTolerance = 1e-9;

// The state of one solution after the other, as Ceres moves it.
class CalibrationSolver {
 public:
  CalibrationSolver(const CalibrationOptions& options, const CalibrationProblem& problem)
      : options_(options),
        problem_(problem),
        poses_(problem.poses),
        points_(problem.points),
        intrinsics_(IntrinsicsOf(problem.camera)),
        is_used_(problem.observations.size(), 1) {}

  // Returns the robust cost; NaN on failure.
  double Solve(bool with_intrinsics, bool with_focal_length);
  // Squared errors in sigma^2, pixels^2 times their number, of the observations in use.
  struct Errors {
    double squared_sigma = 0, squared_px = 0;
    int count = 0;
    double RmsPx() const { return count > 0 ? std::sqrt(squared_px / count) : 0; }
  };
  Errors Measure() const;
  void LeaveOutOutliers();
  CalibrationLinearisation Linearise() const;
  // Takes a step of Linearise's unknowns.
  void Move(const Eigen::VectorXd& step);
  int NumPoints() const;
  const Intrinsics& Found() const { return intrinsics_; }
  void ResetIntrinsics() { intrinsics_ = IntrinsicsOf(problem_.camera); }

 private:
  double SquaredError(const CalibrationObservation& o, const Camera& camera) const {
    const Eigen::Vector3d x = poses_[o.pose] * points_[o.point];
    if (x.z() <= 0) return std::numeric_limits<double>::infinity();
    return (camera.Project(x) - o.pixel).squaredNorm();
  }

  const CalibrationOptions& options_;
  const CalibrationProblem& problem_;
  std::vector<Rigid3> poses_;
  std::vector<Eigen::Vector3d> points_;
  Intrinsics intrinsics_;
  std::vector<char> is_used_;  // per observation
};

double CalibrationSolver::Solve(bool with_intrinsics, bool with_focal_length) {
  SteppedPoses poses(poses_);
  ceres::Problem::Options problem_options;
  problem_options.evaluation_callback = &poses;
  ceres::Problem problem(problem_options);
  auto* ordering = new ceres::ParameterBlockOrdering;
  std::vector<char> is_known(points_.size(), 0), is_posed(poses_.size(), 0);
  for (size_t i = 0; i < problem_.observations.size(); ++i) {
    const CalibrationObservation& o = problem_.observations[i];
    if (!is_used_[i]) continue;
    problem.AddResidualBlock(new CalibrationCost(problem_.camera, poses.At(o.pose), o.pixel, o.sigma),
                             new ceres::HuberLoss(options_.huber), poses.Step(o.pose), points_[o.point].data(),
                             intrinsics_.data());
    if (!is_known[o.point]) ordering->AddElementToGroup(points_[o.point].data(), 0);
    if (!is_posed[o.pose]) ordering->AddElementToGroup(poses.Step(o.pose), 1);
    is_known[o.point] = is_posed[o.pose] = 1;
  }
  if (problem.NumResidualBlocks() == 0) return std::nan("");
  ordering->AddElementToGroup(intrinsics_.data(), 1);
  if (is_posed[0]) problem.SetParameterBlockConstant(poses.Step(0));
  if (!with_intrinsics) {
    problem.SetParameterBlockConstant(intrinsics_.data());
  } else if (!with_focal_length) {
    problem.SetManifold(intrinsics_.data(), new ceres::SubsetManifold(kNumIntrinsics, {0}));
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type =
      static_cast<int>(poses_.size()) <= kMaxDenseCalibrationPoses ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  solver.linear_solver_ordering.reset(ordering);
  solver.max_num_iterations = options_.max_iterations;
  solver.function_tolerance = kFunctionTolerance;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (!summary.IsSolutionUsable()) return std::nan("");
  for (size_t i = 0; i < poses_.size(); ++i) poses_[i] = poses.Result(i);
  return summary.final_cost;
}

CalibrationSolver::Errors CalibrationSolver::Measure() const {
  const Camera camera = WithIntrinsics(problem_.camera, intrinsics_);
  Errors errors;
  for (size_t i = 0; i < is_used_.size(); ++i) {
    const CalibrationObservation& o = problem_.observations[i];
    const double squared = SquaredError(o, camera);
    if (!is_used_[i] || !std::isfinite(squared)) continue;
    errors.squared_px += squared;
    errors.squared_sigma += squared / (o.sigma * o.sigma);
    ++errors.count;
  }
  return errors;
}

void CalibrationSolver::LeaveOutOutliers() {
  const Camera camera = WithIntrinsics(problem_.camera, intrinsics_);
  std::vector<int> left(points_.size(), 0);
  for (size_t i = 0; i < is_used_.size(); ++i) {
    const CalibrationObservation& o = problem_.observations[i];
    is_used_[i] = SquaredError(o, camera) <= options_.outlier_chi2 * o.sigma * o.sigma;
    if (is_used_[i]) ++left[o.point];
  }
  for (size_t i = 0; i < is_used_.size(); ++i) {
    if (left[problem_.observations[i].point] < 2) is_used_[i] = 0;
  }
}

int CalibrationSolver::NumPoints() const {
  std::vector<char> is_seen(points_.size(), 0);
  for (size_t i = 0; i < is_used_.size(); ++i) {
    if (is_used_[i]) is_seen[problem_.observations[i].point] = 1;
  }
  return static_cast<int>(std::count(is_seen.begin(), is_seen.end(), 1));
}

CalibrationLinearisation CalibrationSolver::Linearise() const {
  const SteppedPoses poses(poses_);
  CalibrationLinearisation result(poses_, points_.size());
  for (size_t i = 0; i < is_used_.size(); ++i) {
    if (!is_used_[i]) continue;
    const CalibrationObservation& o = problem_.observations[i];
    const CalibrationCost cost(problem_.camera, poses.At(o.pose), o.pixel, o.sigma);
    const Vector6d no_step = Vector6d::Zero();
    const double* parameters[] = {no_step.data(), points_[o.point].data(), intrinsics_.data()};
    CalibrationRow row;
    row.pose = o.pose;
    row.point = o.point;
    double residuals[2];
    double* jacobians[] = {row.by_pose.data(), row.by_point.data(), row.by_intrinsics.data()};
    cost.Evaluate(parameters, residuals, jacobians);
    const double norm = std::hypot(residuals[0], residuals[1]);
    if (norm > options_.huber) row.Scale(std::sqrt(options_.huber / norm));
    result.Add(row);
  }
  return result;
}

void CalibrationSolver::Move(const Eigen::VectorXd& step) {
  for (size_t i = 0; i < poses_.size(); ++i) poses_[i] = Moved(poses_[i], step.segment<6>(6 * i));
  for (int i = 0; i < kNumIntrinsics; ++i) intrinsics_[i] += step[6 * poses_.size() + i];
  const size_t first = 6 * poses_.size() + kNumIntrinsics;
  for (size_t i = 0; i < points_.size(); ++i) points_[i] += step.segment<3>(first + 3 * i);
}

Calibration Refuse(Calibration result, const std::string& reason) {
  result.success = false;
  result.reason = reason;
  return result;
}

// Relative standard deviation of the focal length, from how much the cost grows when it is changed by a step, with all
// else free. The start is where the normal equations expect everything to go.
double ProfileSigma(const CalibrationOptions& options, const CalibrationSolver& solution, double cost,
                    const Eigen::VectorXd& direction, double variance) {
  double largest = 0;
  for (const double sign : {-1.0, 1.0}) {
    CalibrationSolver moved = solution;
    moved.Move(sign * options.profile_step * direction);
    const double worse = moved.Solve(true, false);
    const double growth = std::max(2 * (worse - cost), 1e-12);
    largest = std::max(largest, options.profile_step / std::sqrt(growth / variance));
  }
  return largest;
}

}  // namespace

Calibration CalibrateByMap(const CalibrationOptions& options, const CalibrationProblem& problem) {
  Calibration result;
  result.camera = problem.camera;
  if (problem.camera.model != Camera::Model::kPinhole) {
    return Refuse(result, "the camera is of the model " + problem.camera.ModelName() +
                              "; only pinhole cameras with radial and tangential distortion can be calibrated");
  }
  if (static_cast<int>(problem.observations.size()) < kMinObservations ||
      static_cast<int>(problem.poses.size()) < kMinPoses) {
    return Refuse(result, Format("the map is too small: %zu keyframes, %zu observations of points",
                                 problem.poses.size(), problem.observations.size()));
  }
  CalibrationSolver solver(options, problem);
  if (std::isnan(solver.Solve(true, true))) return Refuse(result, "bundle adjustment of the map fails");
  solver.LeaveOutOutliers();
  CalibrationSolver as_guessed = solver;
  const double cost = solver.Solve(true, true);
  if (std::isnan(cost)) return Refuse(result, "bundle adjustment of the map fails");
  const CalibrationSolver::Errors errors = solver.Measure();
  result.camera = WithIntrinsics(problem.camera, solver.Found());
  result.rms_after = errors.RmsPx();
  result.num_observations = errors.count;
  result.num_points = solver.NumPoints();
  const double factor = solver.Found()[0];
  const double freedom = 2.0 * errors.count - 6.0 * problem.poses.size() - 3.0 * result.num_points;
  if (freedom < 100) return Refuse(result, "the map is too small: nearly all points are seen twice only");
  const double variance = 2 * cost / freedom;

  const CalibrationLinearisation linear = solver.Linearise();
  const auto covariance = linear.Covariance();
  if (!covariance)
    return Refuse(result, "focal length and motion cannot be told apart: the normal equations are singular");
  const double formal = std::sqrt(variance * (*covariance)(0, 0)) / factor;
  const double profile = ProfileSigma(options, solver, cost, linear.Direction(), variance) / factor;
  const double sigma = std::max(formal, profile);
  result.sigma_focal = sigma * result.camera.fx;
  for (int i = 0; i < 4; ++i) result.sigma_distortion[i] = std::sqrt(variance * (*covariance)(i + 1, i + 1));
  if (!(sigma <= options.max_focal_sigma)) {
    return Refuse(
        result,
        Format("focal length and motion cannot be told apart: this map leaves the focal length open by %.1f %% "
               "(one standard deviation; at most %.1f %%). What helps: images tilted by 20 degrees and more, or "
               "turned about the camera's x or y axis, relief, or flying at two heights with a tilt",
               100 * std::min(sigma, 9.99), 100 * options.max_focal_sigma));
  }
  if (std::abs(std::log(factor)) > options.max_change) {
    return Refuse(result, Format("the focal length would change from %.1f to %.1f px, too much to be believed",
                                 problem.camera.fx, result.camera.fx));
  }
  as_guessed.ResetIntrinsics();
  as_guessed.Solve(false, false);
  result.rms_before = as_guessed.Measure().RmsPx();
  result.success = true;
  return result;
}

std::optional<double> CostWithFreeLens(const CalibrationOptions& options, const CalibrationProblem& problem) {
  const double cost = CalibrationSolver(options, problem).Solve(true, true);
  return std::isnan(cost) ? std::nullopt : std::optional(cost);
}

}  // namespace mapmend
