#include "procs/frontend/initializer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "libs/geometry/pnp.h"
#include "libs/optim/bundle_adjustment.h"
#include "libs/optim/pose_optimization.h"

namespace mapmend {
namespace {

constexpr int kNewFrames = 60;  // partners that are tried first
constexpr int kMaxTrials = 6;   // partners of a range: a bisection of sixty frames
constexpr int kNumBetween = 3;  // frames between the two views that are asked which motion is right

// What brings the median depth of the points to 1.
double ScaleOf(const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> depths;
  depths.reserve(points.size());
  for (const Eigen::Vector3d& x : points) depths.push_back(x.z());
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  return 1.0 / depths[depths.size() / 2];
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
  Keep(frame);
  return result;
}

void Initializer::Keep(const FramePtr& frame) {
  frames_.push_back(frame);
  while (static_cast<int>(frames_.size()) > options_.max_buffered_frames) frames_.pop_front();
}

Initialization Initializer::BeginWith(const FramePtr& first, const FramePtr& second) const {
  const auto at = std::find(frames_.begin(), frames_.end(), first);
  if (at != frames_.end()) return Try(first, second, Between(static_cast<int>(at - frames_.begin())));
  Initialization none;
  none.reason = LossReason::kTooFewMatches;
  return none;
}

std::vector<FramePtr> Initializer::Between(int first) const {
  const int n = static_cast<int>(frames_.size());
  std::vector<FramePtr> between;
  for (int part = 1; part <= kNumBetween; ++part) {
    const int j = first + (n - first) * part / (kNumBetween + 1);
    if (j > first && (between.empty() || between.back() != frames_[j])) between.push_back(frames_[j]);
  }
  return between;
}

// The oldest partner of a range first: it has the widest baseline. If it shares too little with this frame, younger
// ones do more: a bisection finds the oldest that shares enough. A camera that moves forward leaves its first images
// behind quickly.
Initialization Initializer::TryPartners(const FramePtr& frame, int oldest, int newest) const {
  Initialization result;
  result.reason = LossReason::kTooFewMatches;
  for (int trial = 0; trial < kMaxTrials && oldest <= newest; ++trial) {
    const int i = trial == 0 ? oldest : oldest + (newest - oldest) / 2;
    const Initialization attempt = Try(frames_[i], frame, Between(i));
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
                           const TwoViewCandidate& candidate, const std::vector<FramePtr>& between) const {
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

int Initializer::Decide(const Frame& first, const Frame& second, const std::vector<Match>& found,
                        const std::vector<TwoViewCandidate>& candidates, const std::vector<FramePtr>& between) const {
  // Other motions that explain nearly as much: frames between the two must tell.
  std::vector<int> rivals;
  for (size_t i = 0; i < candidates.size(); ++i) {
    const auto support = static_cast<double>(candidates[i].Support());
    if (support > options_.ambiguity_ratio * static_cast<double>(candidates[0].Support()))
      rivals.push_back(static_cast<int>(i));
  }
  int winner = 0;
  if (rivals.size() < 2) return winner;
  double least = std::numeric_limits<double>::infinity(), second_least = least;
  for (const int i : rivals) {
    const double misfit = Misfit(first, second, found, candidates[i], between);
    if (misfit < least) {
      second_least = least;
      least = misfit;
      winner = i;
    } else {
      second_least = std::min(second_least, misfit);
    }
  }
  return options_.max_misfit_ratio * second_least < least ? -1 : winner;
}

Initialization Initializer::Try(const FramePtr& first, const FramePtr& second,
                                const std::vector<FramePtr>& between) const {
  Initialization result;
  result.first = first;
  result.second = second;
  const std::vector<Match> found = MatchBruteForce(first->features, second->features, {});
  result.reason = LossReason::kTooFewMatches;
  if (static_cast<int>(found.size()) < options_.min_matches) return result;
  const MatchedPixels matches = PixelsOf(found, first->features, second->features, camera_, pyramid_);
  result.reason = LossReason::kNoParallax;
  result.cause = LossReason::kNoMotion;
  if (MedianShift(matches) < options_.min_motion * camera_.width) return result;

  const std::vector<TwoViewCandidate> candidates =
      RankMotions(options_.ranking, camera_, matches, options_.max_sigma, options_.seed);
  result.reason = LossReason::kTooFewMatches;
  result.cause = LossReason::kNoCommonMotion;
  const int min_support =
      std::max(options_.min_points, static_cast<int>(options_.min_common_share * options_.min_matches));
  if (candidates.empty() || static_cast<int>(candidates[0].Support()) < min_support) return result;
  result.reason = result.cause = LossReason::kAmbiguous;
  const int winner = Decide(*first, *second, found, candidates, between);
  if (winner < 0) return result;
  const TwoViewCandidate& best = candidates[winner];
  result.reason = result.cause = LossReason::kNoParallax;
  if (static_cast<int>(best.matches.size()) < options_.min_points ||
      best.median_angle_deg < options_.min_median_angle_deg) {
    return result;
  }
  const double scale = ScaleOf(best.points);
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
