#include "procs/frontend/initializer.h"

#include <algorithm>
#include <cmath>

#include "libs/geometry/triangulation.h"
#include "libs/geometry/two_view.h"
#include "libs/mapping/bundle_adjustment.h"

namespace mapmend {
namespace {

constexpr double kMinRayAngleCos = 0.99999;  // 0.26 degrees: nearer to parallel a point has no usable depth
constexpr int kBundlePoints = 150;           // of an image determine the motion in bundle adjustment
constexpr double kSameRotationRad = 0.02, kSameDirectionRad = 0.15;

struct Judged {
  Rigid3 second_from_first;
  std::vector<int> matches;                // indices of the inlier matches
  std::vector<Eigen::Vector3d> points;     // of these, first camera
  double median_angle_deg = 0;
};

struct MatchedPixels {
  std::vector<Eigen::Vector2d> first, second;  // pixels
  std::vector<double> sigma_first, sigma_second;
};

// Triangulates every match under a motion and keeps those that fit.
Judged Judge(const Pinhole& camera, const MatchedPixels& matches, const Rigid3& motion, double max_sigma) {
  Judged judged;
  judged.second_from_first = motion;
  const double limit = max_sigma * max_sigma;
  std::vector<double> angles;
  for (size_t i = 0; i < matches.first.size(); ++i) {
    const auto x = Triangulate(camera.Unproject(matches.first[i]), camera.Unproject(matches.second[i]), motion);
    if (!x) continue;
    if (ReprojectionChi2(camera, {}, *x, matches.first[i], matches.sigma_first[i]) > limit) continue;
    if (ReprojectionChi2(camera, motion, *x, matches.second[i], matches.sigma_second[i]) > limit) continue;
    const double cosine = CosIntersectionAngle(*x, Eigen::Vector3d::Zero(), motion.Center());
    if (cosine > kMinRayAngleCos) continue;
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

}  // namespace

void Initializer::DropBefore(const FramePtr& frame) {
  while (!frames_.empty() && frames_.front() != frame) frames_.pop_front();
}

Initialization Initializer::AddFrame(const FramePtr& frame) {
  Initialization result;
  result.reason = "too_few_matches";
  // Oldest partner first: it has the widest baseline. A few younger ones are tried when it fails, so that one bad frame
  // does not hold up all others.
  constexpr int kMaxTrials = 3;
  int trials = 0;
  const size_t n = frames_.size();
  for (size_t i = 0; i < n && trials < kMaxTrials; ++trials) {
    const Initialization attempt = Try(frames_[i], frame);
    if (attempt.success) {
      result = attempt;
      break;
    }
    if (result.reason == "too_few_matches") result.reason = attempt.reason;
    if (attempt.reason == "no_parallax") break;  // younger frames have less
    // The oldest frame, the middle one, the newest one.
    i = trials == 0 && n > 2 ? n / 2 : std::max(i + 1, n - 1);
  }
  frames_.push_back(frame);
  while (static_cast<int>(frames_.size()) > options_.max_buffered_frames) frames_.pop_front();
  return result;
}

Initialization Initializer::Try(const FramePtr& first, const FramePtr& second) const {
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

  std::vector<Judged> candidates;
  for (const TwoViewHypothesis& h : ProposeTwoViewMotions(rays_first, rays_second, 1.5 / camera_.fx, options_.seed)) {
    candidates.push_back(Judge(camera_, matches, h.second_from_first, 2 * options_.max_sigma));
  }
  const auto by_support = [](const Judged& a, const Judged& b) { return a.matches.size() > b.matches.size(); };
  std::stable_sort(candidates.begin(), candidates.end(), by_support);
  result.reason = "too_few_matches";
  if (candidates.empty() || static_cast<int>(candidates[0].matches.size()) < options_.min_points) return result;
  // Refinement draws like hypotheses together; only what could still win is refined.
  const size_t enough = candidates[0].matches.size() / 2;
  std::erase_if(candidates, [&](const Judged& j) { return j.matches.size() < enough; });
  for (Judged& j : candidates) j = Refine(camera_, matches, std::move(j), options_.max_sigma);
  std::stable_sort(candidates.begin(), candidates.end(), by_support);
  const Judged& best = candidates[0];
  if (static_cast<int>(best.matches.size()) < options_.min_points ||
      best.matches.size() * 2 < static_cast<size_t>(options_.min_matches)) {
    return result;
  }
  result.reason = "no_parallax";
  if (best.median_angle_deg < options_.min_median_angle_deg) return result;
  result.reason = "ambiguous";
  for (const Judged& other : candidates) {
    if (!SameMotion(best.second_from_first, other.second_from_first) &&
        static_cast<double>(other.matches.size()) > options_.ambiguity_ratio * static_cast<double>(best.matches.size())) {
      return result;
    }
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
