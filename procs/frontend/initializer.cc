#include "procs/frontend/initializer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "libs/geometry/pnp.h"
#include "libs/geometry/triangulation.h"
#include "libs/geometry/two_view.h"
#include "libs/optim/bundle_adjustment.h"
#include "libs/optim/pose_optimization.h"

namespace mapmend {
namespace {

constexpr int kNewFrames = 60;  // partners that are tried first

constexpr double kMinRayAngleCos = 0.99999;  // 0.26 degrees: nearer to parallel a point has no usable depth
constexpr int kBundlePoints = 150;           // of an image determine the motion in bundle adjustment
constexpr double kSameRotationRad = 0.02, kSameDirectionRad = 0.15;

constexpr double kFarAway = 1e4;  // baselines: stands for the depth of points that have none

using Judged = TwoViewCandidate;

struct MatchedPixels {
  std::vector<Eigen::Vector2d> first, second;  // pixels
  std::vector<double> sigma_first, sigma_second;
};

// Triangulates every match under a motion and keeps the points that fit. Matches too far away to have a depth fit as
// well if the rotation alone explains them: a small true motion must not lose against a large wrong one that gives
// everything a depth.
Judged Judge(const Pinhole& camera, const MatchedPixels& matches, const Rigid3& motion, double max_sigma) {
  Judged judged;
  judged.second_from_first = motion;
  const double limit = max_sigma * max_sigma;
  const Rigid3 turn(motion.rotation, Eigen::Vector3d::Zero());
  std::vector<double> angles;
  for (size_t i = 0; i < matches.first.size(); ++i) {
    const Eigen::Vector3d ray = camera.Unproject(matches.first[i]);
    const auto fits = [&](const Rigid3& pose, const Eigen::Vector3d& x, const Eigen::Vector2d& pixel, double sigma) {
      return (pose * x).z() > 0 && ReprojectionChi2(camera, pose, x, pixel, sigma) <= limit;
    };
    const bool fits_at_infinity = fits(turn, ray, matches.second[i], matches.sigma_second[i]);
    const auto x = Triangulate(ray, camera.Unproject(matches.second[i]), motion);
    const bool fits_as_point = x && fits({}, *x, matches.first[i], matches.sigma_first[i]) &&
                               fits(motion, *x, matches.second[i], matches.sigma_second[i]);
    if (!fits_as_point && !fits_at_infinity) continue;
    const double cosine = fits_as_point ? CosIntersectionAngle(*x, Eigen::Vector3d::Zero(), motion.Center()) : 1;
    if (cosine > kMinRayAngleCos) {
      judged.far_matches.push_back(static_cast<int>(i));
      judged.far_points.push_back(fits_as_point ? *x : kFarAway * ray);
      continue;
    }
    angles.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / M_PI);
    judged.matches.push_back(static_cast<int>(i));
    judged.points.push_back(*x);
  }
  if (!angles.empty()) {
    std::nth_element(angles.begin(), angles.begin() + angles.size() / 2, angles.end());
    judged.median_angle_deg = angles[angles.size() / 2];
  }
  return judged;
}

// Two-view bundle adjustment of the inliers, then all matches judged anew. |translation| is brought back to 1.
Judged Refine(const Pinhole& camera, const MatchedPixels& matches, Judged judged, double max_sigma) {
  for (int round = 0; round < 2 && judged.Support() >= 20; ++round) {
    BundleProblem problem;
    problem.cameras = {camera};
    problem.poses = {{Rigid3(), true, 0}, {judged.second_from_first, false, 0}};
    problem.points = judged.points;
    problem.points.insert(problem.points.end(), judged.far_points.begin(), judged.far_points.end());
    std::vector<int> all = judged.matches;
    all.insert(all.end(), judged.far_matches.begin(), judged.far_matches.end());
    for (size_t i = 0; i < all.size(); ++i) {
      const int m = all[i], point = static_cast<int>(i);
      problem.observations.push_back({0, point, matches.first[m], matches.sigma_first[m]});
      problem.observations.push_back({1, point, matches.second[m], matches.sigma_second[m]});
    }
    BundleOptions options;
    options.max_iterations = 15;
    options.points_per_pose = kBundlePoints;
    if (!AdjustBundle(options, &problem).success) break;
    Rigid3 motion = problem.poses[1].cam_from_world;
    const double length = motion.translation.norm();
    if (length < 1e-9) break;
    motion.translation /= length;
    judged = Judge(camera, matches, motion, max_sigma);
  }
  return judged;
}

bool SameMotion(const Rigid3& a, const Rigid3& b) {
  return RotationAngle(a.rotation * b.rotation.conjugate()) < kSameRotationRad &&
         std::acos(std::clamp(a.translation.normalized().dot(b.translation.normalized()), -1.0, 1.0)) <
             kSameDirectionRad;
}

// The truly different motions, refined, those that explain most matches first.
std::vector<Judged> RankMotions(const Pinhole& camera, const MatchedPixels& matches,
                                const std::vector<TwoViewHypothesis>& hypotheses, double max_sigma) {
  std::vector<Judged> candidates;
  candidates.reserve(hypotheses.size());
  for (const TwoViewHypothesis& h : hypotheses) {
    candidates.push_back(Judge(camera, matches, h.second_from_first, 2 * max_sigma));
  }
  const auto by_support = [](const Judged& a, const Judged& b) { return a.Support() > b.Support(); };
  std::stable_sort(candidates.begin(), candidates.end(), by_support);
  if (candidates.empty()) return candidates;
  // Refinement draws like hypotheses together; only what could still win is refined.
  const size_t enough = candidates[0].Support() / 2;
  std::erase_if(candidates, [&](const Judged& j) { return j.Support() < enough; });
  for (Judged& j : candidates) j = Refine(camera, matches, std::move(j), max_sigma);
  std::stable_sort(candidates.begin(), candidates.end(), by_support);
  std::vector<Judged> different;
  for (Judged& j : candidates) {
    const auto is_same = [&](const Judged& d) { return SameMotion(d.second_from_first, j.second_from_first); };
    if (std::none_of(different.begin(), different.end(), is_same)) different.push_back(std::move(j));
  }
  return different;
}

}  // namespace

void Initializer::DropBefore(const FramePtr& frame) {
  while (!frames_.empty() && frames_.front() != frame) frames_.pop_front();
}

Initialization Initializer::AddFrame(const FramePtr& frame) {
  Initialization result;
  // At thirty frames a second the next frame tells no more than the one that was refused.
  if (frame->utime < refused_utime_ + static_cast<int64_t>(1e6 * options_.min_retry_s)) {
    result.reason = refused_reason_;
    result.cause = refused_cause_;
  } else {
    // Among the newest first; a camera that turns on the spot may have its baseline to much older ones.
    const int n = static_cast<int>(frames_.size()), split = std::max(0, n - kNewFrames);
    result = TryPartners(frame, split, n - 1);
    if (!result.success && split > 0) {
      const Initialization older = TryPartners(frame, 0, split - 1);
      if (older.success || result.reason == LossReason::kTooFewMatches) result = older;
    }
    if (!result.success && result.reason != LossReason::kTooFewMatches) {
      refused_utime_ = frame->utime;
      refused_reason_ = result.reason;
      refused_cause_ = result.cause;
    }
  }
  frames_.push_back(frame);
  while (static_cast<int>(frames_.size()) > options_.max_buffered_frames) frames_.pop_front();
  return result;
}

// The oldest partner of a range first: it has the widest baseline. If it shares too little with this frame, younger
// ones do more: a bisection finds the oldest that shares enough. A camera that moves forward leaves its first images
// behind quickly.
Initialization Initializer::TryPartners(const FramePtr& frame, int oldest, int newest) const {
  Initialization result;
  result.reason = LossReason::kTooFewMatches;
  constexpr int kMaxTrials = 6;
  const int n = static_cast<int>(frames_.size());
  for (int trial = 0; trial < kMaxTrials && oldest <= newest; ++trial) {
    const int i = trial == 0 ? oldest : oldest + (newest - oldest) / 2;
    std::vector<FramePtr> between;
    for (const int part : {1, 2, 3}) {
      const int j = i + (n - i) * part / 4;
      if (j > i && (between.empty() || between.back() != frames_[j])) between.push_back(frames_[j]);
    }
    const Initialization attempt = Try(frames_[i], frame, between);
    if (attempt.success) return attempt;
    if (result.reason == LossReason::kTooFewMatches) {
      result.reason = attempt.reason;
      if (attempt.cause != LossReason::kTooFewMatches) result.cause = attempt.cause;
    }
    if (attempt.reason == LossReason::kTooFewMatches) {
      oldest = i + 1;
    } else {  // too little parallax to tell: an older one has more
      newest = i - 1;
    }
  }
  return result;
}

// What a motion leaves unexplained in the two views and in frames between them: the sum of squared errors in sigma,
// each cut off at the limit of an inlier, over all matches. A wrong motion that fits two images nearly as well has its
// points at wrong depths, which no pose of a third explains.
double Initializer::Misfit(const Frame& first, const Frame& second, const std::vector<Match>& found,
                           const Judged& candidate, const std::vector<FramePtr>& between) const {
  const double limit = options_.max_sigma * options_.max_sigma;
  std::vector<std::optional<Eigen::Vector3d>> point_of(first.features.Size());
  std::vector<int> features;
  const auto add = [&](const std::vector<int>& of, const std::vector<Eigen::Vector3d>& at) {
    for (size_t i = 0; i < of.size(); ++i) point_of[found[of[i]].a] = at[i];
  };
  add(candidate.matches, candidate.points);
  add(candidate.far_matches, candidate.far_points);
  const auto misfit = [&](const Rigid3& pose, const Frame& frame, int a, int b) {
    if (!point_of[a] || (pose * *point_of[a]).z() <= 0) return limit;
    const Keypoint& keypoint = frame.features.keypoints[b];
    return std::min(limit, ReprojectionChi2(camera_, pose, *point_of[a], keypoint.pixel.cast<double>(),
                                            pyramid_.Sigma(keypoint.octave)));
  };
  double sum = 0;
  for (const Match& m : found) {
    sum += misfit({}, first, m.a, m.a) + misfit(candidate.second_from_first, second, m.a, m.b);
    features.push_back(m.a);
  }
  std::sort(features.begin(), features.end());
  for (const FramePtr& frame : between) {
    const std::vector<Match> matches = MatchBruteForce(first.features, frame->features, {}, features);
    std::vector<Eigen::Vector3d> points;
    std::vector<Eigen::Vector2d> pixels;
    std::vector<double> sigmas;
    std::vector<PoseObservation> observations;
    for (const Match& m : matches) {
      if (!point_of[m.a]) continue;
      const Keypoint& keypoint = frame->features.keypoints[m.b];
      points.push_back(*point_of[m.a]);
      pixels.push_back(keypoint.pixel.cast<double>());
      sigmas.push_back(pyramid_.Sigma(keypoint.octave));
      observations.push_back({points.back(), pixels.back(), sigmas.back()});
    }
    PnpOptions pnp_options;
    pnp_options.seed = options_.seed;
    const PnpResult pnp = SolvePnpRansac(camera_, points, pixels, sigmas, pnp_options);
    const PoseOptimizationResult pose =
        pnp.success ? OptimizePose(camera_, pnp.cam_from_world, observations, {}) : PoseOptimizationResult();
    for (const Match& m : matches) sum += pose.success ? misfit(pose.cam_from_world, *frame, m.a, m.b) : limit;
  }
  return sum;
}

Initialization Initializer::Try(const FramePtr& first, const FramePtr& second,
                                const std::vector<FramePtr>& between) const {
  Initialization result;
  result.first = first;
  result.second = second;
  MatchOptions match_options;
  const std::vector<Match> found = MatchBruteForce(first->features, second->features, match_options);
  result.reason = LossReason::kTooFewMatches;
  if (static_cast<int>(found.size()) < options_.min_matches) return result;

  MatchedPixels matches;
  std::vector<Eigen::Vector2d> rays_first, rays_second;
  std::vector<double> shifts;
  for (const Match& m : found) {
    const Keypoint &a = first->features.keypoints[m.a], &b = second->features.keypoints[m.b];
    matches.first.push_back(a.pixel.cast<double>());
    matches.second.push_back(b.pixel.cast<double>());
    matches.sigma_first.push_back(pyramid_.Sigma(a.octave));
    matches.sigma_second.push_back(pyramid_.Sigma(b.octave));
    rays_first.push_back(camera_.Unproject(matches.first.back()).head<2>());
    rays_second.push_back(camera_.Unproject(matches.second.back()).head<2>());
    shifts.push_back((matches.first.back() - matches.second.back()).norm());
  }
  std::nth_element(shifts.begin(), shifts.begin() + shifts.size() / 2, shifts.end());
  result.reason = LossReason::kNoParallax;
  result.cause = LossReason::kNoMotion;
  if (shifts[shifts.size() / 2] < options_.min_motion * camera_.width) return result;

  const std::vector<Judged> candidates =
      RankMotions(camera_, matches, ProposeTwoViewMotions(rays_first, rays_second, 1.5 / camera_.fx, options_.seed),
                  options_.max_sigma);
  result.reason = LossReason::kTooFewMatches;
  result.cause = LossReason::kNoCommonMotion;
  const int min_support = std::max(options_.min_points, options_.min_matches / 2);
  if (candidates.empty() || static_cast<int>(candidates[0].Support()) < min_support) return result;
  // Other motions that explain nearly as much: frames between the two must tell.
  std::vector<int> rivals;
  for (size_t i = 0; i < candidates.size(); ++i) {
    const auto support = static_cast<double>(candidates[i].Support());
    if (support > options_.ambiguity_ratio * static_cast<double>(candidates[0].Support()))
      rivals.push_back(static_cast<int>(i));
  }
  int winner = 0;
  if (rivals.size() > 1) {
    double least = std::numeric_limits<double>::infinity(), second_least = least;
    for (const int i : rivals) {
      const double misfit = Misfit(*first, *second, found, candidates[i], between);
      if (misfit < least) {
        second_least = least;
        least = misfit;
        winner = i;
      } else {
        second_least = std::min(second_least, misfit);
      }
    }
    result.reason = result.cause = LossReason::kAmbiguous;
    if (options_.max_misfit_ratio * second_least < least) return result;
  }
  const Judged& best = candidates[winner];
  result.reason = result.cause = LossReason::kNoParallax;
  if (static_cast<int>(best.matches.size()) < options_.min_points ||
      best.median_angle_deg < options_.min_median_angle_deg) {
    return result;
  }
  std::vector<double> depths;
  for (const Eigen::Vector3d& x : best.points) depths.push_back(x.z());
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  const double scale = 1.0 / depths[depths.size() / 2];
  result.second_from_first = best.second_from_first;
  result.second_from_first.translation *= scale;
  for (size_t i = 0; i < best.matches.size(); ++i) {
    const Match& m = found[best.matches[i]];
    result.points.push_back({FeatureIndex(m.a), FeatureIndex(m.b), best.points[i] * scale});
  }
  result.success = true;
  result.reason = LossReason::kNone;
  result.cause = LossReason::kNone;
  return result;
}

}  // namespace mapmend
