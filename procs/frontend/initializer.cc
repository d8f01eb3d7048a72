#include "procs/frontend/initializer.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "libs/geometry/pnp.h"
#include "libs/geometry/triangulation.h"
#include "libs/geometry/two_view.h"
#include "libs/mapping/bundle_adjustment.h"
#include "libs/mapping/pose_optimization.h"

namespace mapmend {
namespace {

constexpr double kMinRayAngleCos = 0.99999;  // 0.26 degrees: nearer to parallel a point has no usable depth
constexpr int kBundlePoints = 150;           // of an image determine the motion in bundle adjustment
constexpr double kSameRotationRad = 0.02, kSameDirectionRad = 0.15;

constexpr double kFarAway = 1e4;             // baselines: stands for the depth of points that have none

using Judged = TwoViewCandidate;

struct MatchedPixels {
  std::vector<Eigen::Vector2d> first, second;  // pixels
  std::vector<double> sigma_first, sigma_second;
};

// Triangulates every match under a motion and keeps the points that fit. Matches too far away to have a depth fit as well if
// the rotation alone explains them: a small true motion must not lose against a large wrong one that gives everything a depth.
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
      judged.far_points.push_back(kFarAway * ray);
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
  for (int round = 0; round < 2 && judged.matches.size() >= 20; ++round) {
    BundleProblem problem;
    problem.cameras = {camera};
    problem.poses = {{Rigid3(), true, 0}, {judged.second_from_first, false, 0}};
    problem.points = judged.points;
    for (size_t i = 0; i < judged.matches.size(); ++i) {
      const int m = judged.matches[i], point = static_cast<int>(i);
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
         std::acos(std::clamp(a.translation.normalized().dot(b.translation.normalized()), -1.0, 1.0)) < kSameDirectionRad;
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

}  // namespace

void Initializer::DropBefore(const FramePtr& frame) {
  while (!frames_.empty() && frames_.front() != frame) frames_.pop_front();
}

Initialization Initializer::AddFrame(const FramePtr& frame) {
  Initialization result;
  result.reason = "too_few_matches";
  // The oldest partner first: it has the widest baseline. If it shares too little with this frame, younger ones do more: a
  // bisection finds the oldest that shares enough. A camera that moves forward leaves its first images behind quickly.
  constexpr int kMaxTrials = 5;
  const int n = static_cast<int>(frames_.size());
  int oldest = 0, newest = n - 1;
  for (int trial = 0; trial < kMaxTrials && oldest <= newest; ++trial) {
    const int i = trial == 0 ? oldest : oldest + (newest - oldest) / 2;
    std::vector<FramePtr> between;
    for (const int part : {1, 2, 3}) {
      const int j = i + (n - i) * part / 4;
      if (j > i && (between.empty() || between.back() != frames_[j])) between.push_back(frames_[j]);
    }
    const Initialization attempt = Try(frames_[i], frame, between);
    if (attempt.success) {
      result = attempt;
      break;
    }
    if (result.reason == "too_few_matches") result.reason = attempt.reason;
    if (attempt.reason == "too_few_matches") {
      oldest = i + 1;
    } else {  // too little parallax to tell: an older one has more
      newest = i - 1;
    }
  }
  frames_.push_back(frame);
  while (static_cast<int>(frames_.size()) > options_.max_buffered_frames) frames_.pop_front();
  return result;
}

// Points of a candidate, seen from the frames between its two: how many of them lie where a pose of each such frame puts them.
// A wrong motion with as many inliers in two images has its points at wrong depths, which no pose of a third explains.
int Initializer::SupportBetween(const Frame& first, const std::vector<Match>& found, const Judged& candidate,
                                const std::vector<FramePtr>& between) const {
  std::vector<int> features;
  std::map<int, Eigen::Vector3d> point_of;
  const auto add = [&](const std::vector<int>& of, const std::vector<Eigen::Vector3d>& at) {
    for (size_t i = 0; i < of.size(); ++i) {
      features.push_back(found[of[i]].a);
      point_of[features.back()] = at[i];
    }
  };
  add(candidate.matches, candidate.points);
  add(candidate.far_matches, candidate.far_points);
  if (features.empty()) return 0;
  std::sort(features.begin(), features.end());
  int support = 0;
  for (const FramePtr& frame : between) {
    std::vector<Eigen::Vector3d> points;
    std::vector<Eigen::Vector2d> pixels;
    std::vector<double> sigmas;
    std::vector<PoseObservation> observations;
    for (const Match& m : MatchBruteForce(first.features, frame->features, {}, features)) {
      const Keypoint& keypoint = frame->features.keypoints[m.b];
      points.push_back(point_of.at(m.a));
      pixels.push_back(keypoint.pixel.cast<double>());
      sigmas.push_back(pyramid_.Sigma(keypoint.octave));
      observations.push_back({points.back(), pixels.back(), sigmas.back()});
    }
    PnpOptions pnp_options;
    pnp_options.seed = options_.seed;
    const PnpResult pnp = SolvePnpRansac(camera_, points, pixels, sigmas, pnp_options);
    if (!pnp.success) continue;
    const PoseOptimizationResult pose = OptimizePose(camera_, pnp.cam_from_world, observations, {});
    if (pose.success) support += pose.num_inliers;
  }
  return support;
}

Initialization Initializer::Try(const FramePtr& first, const FramePtr& second, const std::vector<FramePtr>& between) const {
  Initialization result;
  result.first = first;
  result.second = second;
  MatchOptions match_options;
  const std::vector<Match> found = MatchBruteForce(first->features, second->features, match_options);
  result.reason = "too_few_matches";
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
  result.reason = "no_parallax";
  if (shifts[shifts.size() / 2] < options_.min_motion * camera_.width) return result;

  const std::vector<Judged> candidates = RankMotions(
      camera_, matches, ProposeTwoViewMotions(rays_first, rays_second, 1.5 / camera_.fx, options_.seed), options_.max_sigma);
  result.reason = "too_few_matches";
  const int min_support = std::max(options_.min_points, options_.min_matches / 2);
  if (candidates.empty() || static_cast<int>(candidates[0].Support()) < min_support) return result;
  // Other motions that explain nearly as much: frames between the two must tell.
  std::vector<int> rivals;
  for (size_t i = 0; i < candidates.size(); ++i) {
    const auto support = static_cast<double>(candidates[i].Support());
    if (support > options_.ambiguity_ratio * static_cast<double>(candidates[0].Support())) rivals.push_back(static_cast<int>(i));
  }
  int winner = 0, best_support = 0, second_support = 0;
  if (rivals.size() > 1) {
    for (const int i : rivals) {
      const int support = SupportBetween(*first, found, candidates[i], between);
      if (support > best_support) {
        second_support = best_support;
        best_support = support;
        winner = i;
      } else {
        second_support = std::max(second_support, support);
      }
    }
    result.reason = "ambiguous";
    if (second_support >= options_.ambiguity_ratio * best_support) return result;
  }
  const Judged& best = candidates[winner];
  result.reason = "no_parallax";
  if (static_cast<int>(best.matches.size()) < options_.min_points || best.median_angle_deg < options_.min_median_angle_deg) {
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
    result.points.push_back({m.a, m.b, best.points[i] * scale});
  }
  result.success = true;
  result.reason.clear();
  return result;
}

}  // namespace mapmend
