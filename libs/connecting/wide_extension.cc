#include "libs/connecting/wide_extension.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "libs/base/options.h"
#include "libs/geometry/pnp.h"
#include "libs/optim/pose_optimization.h"
#include "libs/optim/pose_uncertainty.h"

namespace mapmend {
namespace {

// Points of the side that look like features of the frame, each point and each feature at most once.
std::vector<PoseObservation> LookForPoints(const WideSide& side, const WideFrame& frame, int num_before,
                                           const WideMatchingOptions& options) {
  std::map<std::pair<int, int>, int> votes;  // (track, feature)
  const int n = static_cast<int>(side.frames.size());
  for (int g = std::max(0, n - num_before); g < n; ++g) {
    for (const WideMatch& m : MatchWide(*side.frames[g].features, *frame.features, options)) {
      const int track = side.track_of[g][m.a];
      if (side.tracks[track].has_point) ++votes[{track, m.b}];
    }
  }
  std::vector<std::pair<int, std::pair<int, int>>> ranked;
  for (const auto& [pair, count] : votes) ranked.emplace_back(-count, pair);
  std::sort(ranked.begin(), ranked.end());
  std::set<int> used_tracks, used_features;
  std::vector<PoseObservation> observations;
  for (const auto& [count, pair] : ranked) {
    if (used_tracks.contains(pair.first) || used_features.contains(pair.second)) continue;
    used_tracks.insert(pair.first);
    used_features.insert(pair.second);
    const WideKeypoint& keypoint = frame.features->keypoints[pair.second];
    observations.push_back({side.tracks[pair.first].point, keypoint.pixel.cast<double>(), WideSigma(keypoint)});
  }
  return observations;
}

int CountCells(const std::vector<PoseObservation>& observations, const Pinhole& camera) {
  std::set<int> cells;
  for (const PoseObservation& o : observations) {
    const int column = std::clamp(static_cast<int>(8 * o.pixel.x() / camera.width), 0, 7);
    const int row = std::clamp(static_cast<int>(6 * o.pixel.y() / camera.height), 0, 5);
    cells.insert(8 * row + column);
  }
  return static_cast<int>(cells.size());
}

std::optional<Rigid3> FindPose(const WideSide& side, const WideFrame& frame, int num_before,
                               const WideExtensionOptions& options) {
  const std::vector<PoseObservation> observations = LookForPoints(side, frame, num_before, options.matching);
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  std::vector<double> sigmas;
  for (const PoseObservation& o : observations) {
    points.push_back(o.point);
    pixels.push_back(o.pixel);
    sigmas.push_back(o.sigma);
  }
  PnpOptions pnp;
  pnp.threshold_px = options.threshold_px;
  pnp.seed = options.seed;
  pnp.max_iterations = 1000;
  const PnpResult found = SolvePnpRansac(side.view.camera, points, pixels, sigmas, pnp);
  if (!found.success || found.num_inliers < options.min_inliers) return std::nullopt;
  PoseOptimizationOptions refinement;
  refinement.outlier_chi2 = options.max_squared_error;
  const PoseOptimizationResult pose = OptimizePose(side.view.camera, found.cam_from_world, observations, refinement);
  if (!pose.success || pose.num_inliers < options.min_inliers) return std::nullopt;
  std::vector<PoseObservation> inliers;
  for (size_t i = 0; i < observations.size(); ++i) {
    if (pose.inlier[i]) inliers.push_back(observations[i]);
  }
  if (CountCells(inliers, side.view.camera) < options.min_cells) return std::nullopt;
  if (!(RelativePositionSigma(side.view.camera, pose.cam_from_world, inliers) <= options.max_position_sigma))
    return std::nullopt;
  return pose.cam_from_world;
}

}  // namespace

std::string WideExtensionOptions::Check() const { return CheckOptions(*this); }

int ExtendWideSide(std::vector<WideFrame> frames, const WideTrackOptions& tracks, const WideExtensionOptions& options,
                   WideSide* side) {
  int num_joined = 0;
  for (WideFrame& frame : frames) {
    const std::optional<Rigid3> pose = FindPose(*side, frame, tracks.num_before, options);
    if (!pose) continue;
    frame.cam_from_submap = *pose;
    AddWideFrame(std::move(frame), tracks, side);
    ++num_joined;
  }
  return num_joined;
}

}  // namespace mapmend
