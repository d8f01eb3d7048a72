#include "procs/frontend/initializer.h"

#include <algorithm>
#include <cmath>

#include "libs/geometry/triangulation.h"
#include "libs/geometry/two_view.h"
#include "libs/optim/bundle_adjustment.h"

namespace mapmend {
namespace {

constexpr int kNewFrames = 60;  // partners that are tried first

constexpr double kMinRayAngleCos = 0.99999;  // 0.26 degrees: nearer to parallel a point has no usable depth
constexpr int kBundlePoints = 150;           // of an image determine the motion in bundle adjustment
constexpr double kSameRotationRad = 0.02, kSameDirectionRad = 0.15;

constexpr double kSameSigmas = 3;  // translations that differ by less than so many standard deviations are the same

constexpr double kClearRatio = 0.67;  // of the squared errors to a rival's, to be certain at once

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

// direction: radians between the translations that are the same in any case
bool SameMotion(const Rigid3& a, const Rigid3& b, double direction = kSameDirectionRad) {
  return RotationAngle(a.rotation * b.rotation.conjugate()) < kSameRotationRad &&
         std::acos(std::clamp(a.translation.normalized().dot(b.translation.normalized()), -1.0, 1.0)) <
             std::max(direction, kSameDirectionRad);
}

// The truly different motions, refined, those that explain most matches first.
std::vector<Judged> RankMotions(const Pinhole& camera, const MatchedPixels& matches,
                                const std::vector<TwoViewHypothesis>& hypotheses, double max_sigma) {
  std::vector<Judged> candidates;
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

MatchedPixels TakePixels(const Frame& first, const Frame& second, const std::vector<Match>& found,
                         const Pyramid& pyramid) {
  MatchedPixels matches;
  for (const Match& m : found) {
    const Keypoint &a = first.features.keypoints[m.a], &b = second.features.keypoints[m.b];
    matches.first.push_back(a.pixel.cast<double>());
    matches.second.push_back(b.pixel.cast<double>());
    matches.sigma_first.push_back(pyramid.Sigma(a.octave));
    matches.sigma_second.push_back(pyramid.Sigma(b.octave));
  }
  return matches;
}

double MedianShift(const MatchedPixels& matches) {
  std::vector<double> shifts;
  for (size_t i = 0; i < matches.first.size(); ++i) shifts.push_back((matches.first[i] - matches.second[i]).norm());
  std::nth_element(shifts.begin(), shifts.begin() + shifts.size() / 2, shifts.end());
  return shifts[shifts.size() / 2];
}

std::vector<TwoViewHypothesis> Propose(const Pinhole& camera, const MatchedPixels& matches, uint64_t seed) {
  std::vector<Eigen::Vector2d> rays_first, rays_second;
  for (size_t i = 0; i < matches.first.size(); ++i) {
    rays_first.push_back(camera.Unproject(matches.first[i]).head<2>());
    rays_second.push_back(camera.Unproject(matches.second[i]).head<2>());
  }
  return ProposeTwoViewMotions(rays_first, rays_second, 1.5 / camera.fx, seed);
}

}  // namespace

void Initializer::DropBefore(const FramePtr& frame) {
  proof_.Clear();
  while (!frames_.empty() && frames_.front() != frame) frames_.pop_front();
}

Initialization Initializer::AddFrame(const FramePtr& frame) {
  Initialization result;
  // At thirty frames a second the next frame tells no more than the one that was refused.
  if (frame->utime < refused_utime_ + RetryInterval()) {
    result.reason = refused_reason_;
    result.cause = refused_cause_;
  } else {
    // Among the newest first; a camera that turns on the spot may have its baseline to much older ones.
    const int n = static_cast<int>(frames_.size()), split = std::max(0, n - kNewFrames);
    result = TryPartners(frame, split, n - 1);
    if (!result.is_plausible && split > 0) {
      const Initialization older = TryPartners(frame, 0, split - 1);
      if (older.is_plausible || result.reason == LossReason::kTooFewMatches) result = older;
    }
    if (result.is_plausible && proof_.Weigh(&result)) {
      result.success = true;
      result.reason = result.cause = LossReason::kNone;
    }
    if (!result.success && result.reason != LossReason::kTooFewMatches) {
      refused_utime_ = frame->utime;
      refused_reason_ = result.reason;
      refused_cause_ = result.cause;
    }
  }
  proof_.CountFrame();
  frames_.push_back(frame);
  while (static_cast<int>(frames_.size()) > options_.max_buffered_frames) frames_.pop_front();
  return result;
}

// The longer the frames wait already, the longer it takes until they show clearly more parallax.
int64_t Initializer::RetryInterval() const {
  const int64_t waited = frames_.empty() ? 0 : refused_utime_ - frames_.front()->utime;
  return std::max(static_cast<int64_t>(1e6 * options_.min_retry_s),
                  static_cast<int64_t>(options_.min_retry_share * static_cast<double>(waited)));
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
    if (attempt.is_plausible) return attempt;
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

// The motion that explains the window's frames clearly best, and how certain it is. Others that explain nearly as many
// matches of the two views are adjusted with all frames as well: a wrong motion that fits two images nearly as well has
// its points at wrong depths, which no pose of a third explains.
LossReason Initializer::Prove(const BeginningWindow& window, const std::vector<TwoViewCandidate>& candidates,
                              WindowAdjustment* winner) const {
  WindowOptions window_options = options_.window;
  window_options.max_sigma = options_.max_sigma;
  window_options.seed = options_.seed;
  std::vector<WindowAdjustment> rivals;
  for (const TwoViewCandidate& candidate : candidates) {
    if (static_cast<double>(candidate.Support()) <=
        options_.ambiguity_ratio * static_cast<double>(candidates[0].Support()))
      continue;
    WindowAdjustment rival = AdjustWindow(window_options, camera_, pyramid_, window, candidate);
    if (rival.success) rivals.push_back(std::move(rival));
  }
  if (rivals.empty()) return LossReason::kTooFewMatches;
  const auto by_misfit = [](const WindowAdjustment& a, const WindowAdjustment& b) { return a.misfit < b.misfit; };
  std::stable_sort(rivals.begin(), rivals.end(), by_misfit);
  *winner = std::move(rivals[0]);
  for (size_t i = 1; i < rivals.size(); ++i) {
    if (SameMotion(rivals[i].other_from_first.back(), winner->other_from_first.back(),
                   kSameSigmas * std::max(rivals[i].shape_sigma, winner->shape_sigma)))
      continue;  // one motion, as well as it is known
    if (options_.max_misfit_ratio * rivals[i].misfit < winner->misfit) return LossReason::kAmbiguous;
    // Its covariance knows nothing of a rival: it has to be foretold.
    if (kClearRatio * rivals[i].misfit < winner->misfit)
      winner->shape_sigma = std::max(winner->shape_sigma, 2 * options_.proof.certain_sigma);
  }
  return LossReason::kNone;
}

// Poses and points of the window, with a median depth of 1; points that no two views fix are left out.
void Initializer::TakeMap(const BeginningWindow& window, const WindowAdjustment& adjusted,
                          Initialization* result) const {
  const auto fits = [&](const Rigid3& pose, const Eigen::Vector3d& x, const Frame& frame, int feature) {
    const Keypoint& keypoint = frame.features.keypoints[feature];
    return ReprojectionChi2(camera_, pose, x, keypoint.pixel.cast<double>(), pyramid_.Sigma(keypoint.octave)) <=
           options_.max_sigma * options_.max_sigma;
  };
  std::vector<std::vector<int>> seen(window.others.size(), std::vector<int>(window.first->features.Size(), -1));
  for (size_t v = 0; v < window.others.size(); ++v) {
    for (const Match& m : window.others[v].matches) seen[v][m.a] = m.b;
  }
  const Rigid3& second_from_first = adjusted.other_from_first.back();
  std::vector<double> depths, cosines;
  for (size_t v = 0; v + 1 < window.others.size(); ++v) {
    if (adjusted.has_pose[v]) result->between.push_back({window.others[v].frame, adjusted.other_from_first[v], {}});
  }
  for (size_t i = 0; i < adjusted.features.size(); ++i) {
    const int feature = adjusted.features[i];
    const Eigen::Vector3d& x = adjusted.points[i];
    if (x.z() <= 0 || !fits({}, x, *window.first, feature) ||
        !fits(second_from_first, x, *result->second, seen.back()[feature]))
      continue;
    const double cosine = CosIntersectionAngle(x, Eigen::Vector3d::Zero(), second_from_first.Center());
    if (cosine > kMinRayAngleCos) continue;
    cosines.push_back(cosine);
    depths.push_back(x.z());
    result->points.push_back({feature, seen.back()[feature], x});
    size_t view = 0;
    for (size_t v = 0; v + 1 < window.others.size(); ++v) {
      if (!adjusted.has_pose[v]) continue;
      const int other = seen[v][feature];
      const bool is_seen = other >= 0 && fits(adjusted.other_from_first[v], x, *window.others[v].frame, other);
      result->between[view++].features.push_back(is_seen ? other : -1);
    }
  }
  if (depths.empty()) return;
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  std::nth_element(cosines.begin(), cosines.begin() + cosines.size() / 2, cosines.end());
  const double scale = 1.0 / depths[depths.size() / 2];
  result->median_angle_deg = std::acos(std::clamp(cosines[cosines.size() / 2], -1.0, 1.0)) * 180 / M_PI;
  result->second_from_first = second_from_first;
  result->second_from_first.translation *= scale;
  for (InitialPoint& p : result->points) p.position *= scale;
  for (InitialView& view : result->between) view.from_first.translation *= scale;
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
  const MatchedPixels matches = TakePixels(*first, *second, found, pyramid_);
  result.reason = LossReason::kNoParallax;
  result.cause = LossReason::kNoMotion;
  if (MedianShift(matches) < options_.min_motion * camera_.width) return result;

  const std::vector<TwoViewCandidate> candidates =
      RankMotions(camera_, matches, Propose(camera_, matches, options_.seed), options_.max_sigma);
  result.reason = LossReason::kTooFewMatches;
  result.cause = LossReason::kNoCommonMotion;
  const int min_support = std::max(options_.min_points, options_.min_matches / 2);
  if (candidates.empty() || static_cast<int>(candidates[0].Support()) < min_support) return result;
  const BeginningWindow window = MakeBeginningWindow(first, second, found, between);
  WindowAdjustment winner;
  result.reason = result.cause = Prove(window, candidates, &winner);
  if (result.reason != LossReason::kNone) return result;
  TakeMap(window, winner, &result);
  result.shape_sigma = winner.shape_sigma;
  result.reason = result.cause = LossReason::kNoParallax;
  if (static_cast<int>(result.points.size()) < options_.min_points ||
      result.median_angle_deg < options_.min_median_angle_deg)
    return result;
  result.is_plausible = true;
  return result;
}

}  // namespace mapmend
