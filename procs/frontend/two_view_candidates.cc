#include "procs/frontend/two_view_candidates.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "libs/geometry/triangulation.h"
#include "libs/geometry/two_view.h"
#include "libs/optim/bundle_adjustment.h"

namespace mapmend {
namespace {

constexpr double kMinRayAngleCos = 0.99999;  // 0.26 degrees: nearer to parallel a point has no usable depth
constexpr double kFarAway = 1e4;             // baselines: stands for the depth of points that have none
constexpr int kRefinements = 2;              // all matches are judged anew after each
constexpr int kBundleIterations = 15;
constexpr size_t kMinRefinable = 20;  // matches: a motion that explains fewer stays as it is
constexpr int kBundlePoints = 150;    // of an image determine the motion in bundle adjustment
constexpr double kNoBaseline = 1e-9;  // of a translation that says nothing of its direction
// Motions nearer to each other than this are one: two views tell the direction worse than the rotation.
constexpr double kSameRotationRad = 0.02, kSameDirectionRad = 0.15;

// Triangulates every match under a motion and keeps the points that fit. Matches too far away to have a depth fit as
// well if the rotation alone explains them: a small true motion must not lose against a large wrong one that gives
// everything a depth.
TwoViewCandidate Judge(const Pinhole& camera, const MatchedPixels& matches, const Rigid3& motion, double max_sigma) {
  TwoViewCandidate judged;
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
TwoViewCandidate Refine(const Pinhole& camera, const MatchedPixels& matches, TwoViewCandidate judged,
                        double max_sigma) {
  for (int round = 0; round < kRefinements && judged.Support() >= kMinRefinable; ++round) {
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
    options.max_iterations = kBundleIterations;
    options.points_per_pose = kBundlePoints;
    if (!AdjustBundle(options, &problem).success) break;
    Rigid3 motion = problem.poses[1].cam_from_world;
    const double length = motion.translation.norm();
    if (length < kNoBaseline) break;
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

}  // namespace

MatchedPixels PixelsOf(const std::vector<Match>& matches, const Features& first, const Features& second,
                       const Pinhole& camera, const Pyramid& pyramid) {
  MatchedPixels pixels;
  for (const Match& m : matches) {
    const Keypoint &a = first.keypoints[m.a], &b = second.keypoints[m.b];
    pixels.first.push_back(a.pixel.cast<double>());
    pixels.second.push_back(b.pixel.cast<double>());
    pixels.sigma_first.push_back(pyramid.Sigma(a.octave));
    pixels.sigma_second.push_back(pyramid.Sigma(b.octave));
    pixels.ray_first.push_back(camera.Unproject(pixels.first.back()).head<2>());
    pixels.ray_second.push_back(camera.Unproject(pixels.second.back()).head<2>());
  }
  return pixels;
}

double MedianShift(const MatchedPixels& matches) {
  std::vector<double> shifts;
  shifts.reserve(matches.first.size());
  for (size_t i = 0; i < matches.first.size(); ++i) shifts.push_back((matches.first[i] - matches.second[i]).norm());
  std::nth_element(shifts.begin(), shifts.begin() + shifts.size() / 2, shifts.end());
  return shifts[shifts.size() / 2];
}

std::vector<TwoViewCandidate> RankMotions(const MotionRankingOptions& options, const Pinhole& camera,
                                          const MatchedPixels& matches, double max_sigma, uint64_t seed) {
  const std::vector<TwoViewHypothesis> hypotheses =
      ProposeTwoViewMotions(matches.ray_first, matches.ray_second, options.proposal_error_px / camera.fx, seed);
  std::vector<TwoViewCandidate> candidates;
  candidates.reserve(hypotheses.size());
  for (const TwoViewHypothesis& h : hypotheses) {
    candidates.push_back(Judge(camera, matches, h.second_from_first, options.unrefined_sigma_factor * max_sigma));
  }
  const auto by_support = [](const TwoViewCandidate& a, const TwoViewCandidate& b) {
    return a.Support() > b.Support();
  };
  std::stable_sort(candidates.begin(), candidates.end(), by_support);
  if (candidates.empty()) return candidates;
  // Refinement draws like hypotheses together; only what could still win is refined.
  const auto enough = static_cast<size_t>(options.min_refined_share * static_cast<double>(candidates[0].Support()));
  std::erase_if(candidates, [&](const TwoViewCandidate& j) { return j.Support() < enough; });
  for (TwoViewCandidate& j : candidates) j = Refine(camera, matches, std::move(j), max_sigma);
  std::stable_sort(candidates.begin(), candidates.end(), by_support);
  std::vector<TwoViewCandidate> different;
  for (TwoViewCandidate& j : candidates) {
    const auto is_same = [&](const TwoViewCandidate& d) {
      return SameMotion(d.second_from_first, j.second_from_first);
    };
    if (std::none_of(different.begin(), different.end(), is_same)) different.push_back(std::move(j));
  }
  return different;
}

}  // namespace mapmend
