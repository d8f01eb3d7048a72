#include "procs/frontend/beginning_window.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "libs/geometry/pnp.h"
#include "libs/geometry/triangulation.h"
#include "libs/optim/bundle_adjustment.h"
#include "libs/optim/pose_optimization.h"
#include "libs/optim/shape_uncertainty.h"

namespace mapmend {
namespace {

constexpr double kLenient = 4;  // times the limit of an inlier: what may still become one takes part

// One candidate's window while it is adjusted. Points have the index of their match with the second view.
class Adjustment {
 public:
  Adjustment(const WindowOptions& options, const Pinhole& camera, const Pyramid& pyramid, const BeginningWindow& window)
      : options_(options), camera_(camera), pyramid_(pyramid), window_(window) {}

  WindowAdjustment Run(const TwoViewCandidate& candidate) {
    TakePoints(candidate);
    TakePoses(candidate);
    BuildProblem();
    for (int round = 0; round < options_.rounds; ++round) {
      if (!AdjustRound(round == 0)) return result_;
    }
    result_.success = true;
    for (size_t i = 0; i < window_.others.size(); ++i) {
      if (result_.has_pose[i]) result_.other_from_first[i] = problem_.poses[pose_of_[i]].cam_from_world;
    }
    result_.points = problem_.points;
    Judge();
    return result_;
  }

 private:
  void TakePoints(const TwoViewCandidate& candidate) {
    const std::vector<Match>& matches = window_.others.back().matches;
    point_of_.assign(window_.first->features.Size(), -1);
    const auto add = [&](const std::vector<int>& of, const std::vector<Eigen::Vector3d>& at) {
      for (size_t i = 0; i < of.size(); ++i) {
        point_of_[matches[of[i]].a] = static_cast<int>(result_.points.size());
        result_.features.push_back(matches[of[i]].a);
        result_.points.push_back(at[i]);
      }
    };
    add(candidate.matches, candidate.points);
    add(candidate.far_matches, candidate.far_points);
  }

  void TakePoses(const TwoViewCandidate& candidate) {
    for (const BeginningWindow::Other& other : window_.others) {
      const bool is_second = &other == &window_.others.back();
      const std::optional<Rigid3> pose = is_second ? candidate.second_from_first : FindPose(other);
      result_.has_pose.push_back(pose.has_value());
      result_.other_from_first.push_back(pose.value_or(Rigid3()));
    }
  }

  std::optional<Rigid3> FindPose(const BeginningWindow::Other& other) const {
    std::vector<Eigen::Vector3d> points;
    std::vector<Eigen::Vector2d> pixels;
    std::vector<double> sigmas;
    std::vector<PoseObservation> observations;
    for (const Match& m : other.matches) {
      if (point_of_[m.a] < 0) continue;
      const Keypoint& keypoint = other.frame->features.keypoints[m.b];
      points.push_back(result_.points[point_of_[m.a]]);
      pixels.push_back(keypoint.pixel.cast<double>());
      sigmas.push_back(pyramid_.Sigma(keypoint.octave));
      observations.push_back({points.back(), pixels.back(), sigmas.back()});
    }
    if (static_cast<int>(points.size()) < options_.min_points) return std::nullopt;
    PnpOptions pnp_options;
    pnp_options.seed = options_.seed;
    const PnpResult pnp = SolvePnpRansac(camera_, points, pixels, sigmas, pnp_options);
    if (!pnp.success) return std::nullopt;
    const PoseOptimizationResult pose = OptimizePose(camera_, pnp.cam_from_world, observations, {});
    if (!pose.success || pose.num_inliers < options_.min_points) return std::nullopt;
    return pose.cam_from_world;
  }

  void AddObservation(int pose, int point, const Keypoint& keypoint) {
    problem_.observations.push_back({pose, point, keypoint.pixel.cast<double>(), pyramid_.Sigma(keypoint.octave)});
  }

  void BuildProblem() {
    problem_.cameras = {camera_};
    problem_.poses = {{Rigid3(), true, 0}};
    problem_.points = result_.points;
    for (size_t i = 0; i < result_.features.size(); ++i)
      AddObservation(0, static_cast<int>(i), window_.first->features.keypoints[result_.features[i]]);
    for (size_t i = 0; i < window_.others.size(); ++i) {
      pose_of_.push_back(result_.has_pose[i] ? static_cast<int>(problem_.poses.size()) : -1);
      if (!result_.has_pose[i]) continue;
      problem_.poses.push_back({result_.other_from_first[i], false, 0});
      for (const Match& m : window_.others[i].matches) {
        if (point_of_[m.a] >= 0)
          AddObservation(pose_of_[i], point_of_[m.a], window_.others[i].frame->features.keypoints[m.b]);
      }
    }
  }

  double Chi2(const BundleObservation& o) const {
    return ReprojectionChi2(camera_, problem_.poses[o.pose].cam_from_world, problem_.points[o.point], o.pixel, o.sigma);
  }

  // Bundle adjustment of the observations that fit (in the first round: of all), then a better place, if there is one,
  // for points that do not.
  bool AdjustRound(bool is_first) {
    const double limit = options_.max_sigma * options_.max_sigma;
    BundleProblem fitting = problem_;
    if (!is_first) {
      fitting.observations.clear();
      for (const BundleObservation& o : problem_.observations) {
        if (Chi2(o) <= kLenient * limit) fitting.observations.push_back(o);
      }
    }
    BundleOptions bundle;
    bundle.max_iterations = options_.max_iterations;
    bundle.points_per_pose = options_.points_per_pose;
    bundle.function_tolerance = 1e-6;
    if (!AdjustBundle(bundle, &fitting).success) return false;
    problem_.poses = fitting.poses;
    problem_.points = fitting.points;
    PlaceAnew();
    return true;
  }

  // Points of which the two views could be explained better where they intersect.
  void PlaceAnew() {
    const double limit = options_.max_sigma * options_.max_sigma;
    std::vector<std::vector<const BundleObservation*>> of_point(problem_.points.size());
    for (const BundleObservation& o : problem_.observations) of_point[o.point].push_back(&o);
    for (size_t i = 0; i < of_point.size(); ++i) {
      const auto cost = [&] {
        double sum = 0;
        for (const BundleObservation* o : of_point[i]) sum += std::min(limit, Chi2(*o));
        return sum;
      };
      const double before = cost();
      if (of_point[i].size() < 2 || before < limit) continue;
      const BundleObservation &a = *of_point[i].front(), &b = *of_point[i].back();
      const Eigen::Vector3d old = problem_.points[i];
      const auto x =
          Triangulate(camera_.Unproject(a.pixel), camera_.Unproject(b.pixel), problem_.poses[b.pose].cam_from_world);
      if (!x) continue;
      problem_.points[i] = *x;
      if (cost() >= before) problem_.points[i] = old;
    }
  }

  void Judge() {
    const double limit = options_.max_sigma * options_.max_sigma;
    std::vector<double> inliers;
    double explained = 0;
    for (const BundleObservation& o : problem_.observations) {
      const double chi2 = Chi2(o);
      explained += std::min(limit, chi2);
      if (chi2 <= limit) inliers.push_back(chi2);
    }
    size_t num_matches = window_.others.back().matches.size();  // as observations of the first frame
    for (const BeginningWindow::Other& other : window_.others) num_matches += other.matches.size();
    result_.misfit = explained + limit * static_cast<double>(num_matches - problem_.observations.size());
    // Noise by the median of the inliers, of which a point takes three of four (two views) or fewer degrees of freedom.
    double noise = 1;
    if (!inliers.empty()) {
      const auto middle = inliers.begin() + static_cast<long>(inliers.size() / 2);
      std::nth_element(inliers.begin(), middle, inliers.end());
      constexpr double kMedianChi2 = 1.386;  // of two degrees of freedom
      const double degrees = 2.0 * static_cast<double>(problem_.observations.size());
      const double taken =
          3.0 * static_cast<double>(problem_.points.size()) + 6.0 * static_cast<double>(problem_.poses.size() - 1);
      noise = std::max(1.0, *middle / kMedianChi2 / std::max(0.1, 1 - taken / degrees));
    }
    result_.shape_sigma = std::sqrt(noise) * RelativeShapeSigma(problem_, limit);
  }

  const WindowOptions& options_;
  const Pinhole& camera_;
  const Pyramid& pyramid_;
  const BeginningWindow& window_;
  std::vector<int> point_of_;  // per feature of the first frame
  std::vector<int> pose_of_;   // per other frame, in the problem
  BundleProblem problem_;
  WindowAdjustment result_;
};

}  // namespace

BeginningWindow MakeBeginningWindow(const FramePtr& first, const FramePtr& second, const std::vector<Match>& matches,
                                    const std::vector<FramePtr>& between) {
  std::vector<int> features;
  for (const Match& m : matches) features.push_back(m.a);
  std::sort(features.begin(), features.end());
  BeginningWindow window;
  window.first = first;
  for (const FramePtr& frame : between)
    window.others.push_back({frame, MatchBruteForce(first->features, frame->features, {}, features)});
  window.others.push_back({second, matches});
  return window;
}

WindowAdjustment AdjustWindow(const WindowOptions& options, const Pinhole& camera, const Pyramid& pyramid,
                              const BeginningWindow& window, const TwoViewCandidate& candidate) {
  return Adjustment(options, camera, pyramid, window).Run(candidate);
}

}  // namespace mapmend
