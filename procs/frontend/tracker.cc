#include "procs/frontend/tracker.h"

#include <algorithm>
#include <set>

#include "libs/geometry/pnp.h"
#include "libs/optim/bundle_adjustment.h"
#include "libs/optim/pose_uncertainty.h"
#include "procs/frontend/profiler.h"

namespace mapmend {
namespace {

constexpr int kBeyondAnyDistance = 257;             // bits; descriptors have 256
constexpr int kSpreadColumns = 8, kSpreadRows = 6;  // of the cells that min_spread counts

double Spread(const Frame& frame, const Pinhole& camera) {
  std::set<int> cells;
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (frame.points[i] < 0) continue;
    const Eigen::Vector2f& p = frame.features.keypoints[i].pixel;
    const int x = std::clamp(static_cast<int>(p.x() * kSpreadColumns / camera.width), 0, kSpreadColumns - 1);
    const int y = std::clamp(static_cast<int>(p.y() * kSpreadRows / camera.height), 0, kSpreadRows - 1);
    cells.insert(y * kSpreadColumns + x);
  }
  return static_cast<double>(cells.size()) / (kSpreadColumns * kSpreadRows);
}

}  // namespace

std::vector<int> Tracker::VisiblePoints(const WorkingMap& map, const std::vector<int>& points,
                                        const Rigid3& pose) const {
  std::vector<int> visible;
  const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
  const Eigen::Vector3d center = pose.Center();
  for (const int index : points) {
    const WorkingPoint& point = map.Point(index);
    if (point.removed) continue;
    const Eigen::Vector3d x = R * point.position + pose.translation;
    if (x.z() <= 0) continue;
    const Eigen::Vector2d pixel = camera_.Project(x);
    if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= camera_.width || pixel.y() >= camera_.height) continue;
    const Eigen::Vector3d to_camera = center - point.position;
    if (to_camera.dot(point.normal) >= options_.min_view_cos * to_camera.norm()) visible.push_back(index);
  }
  return visible;
}

int Tracker::SearchPoints(const WorkingMap& map, const std::vector<int>& points, const Rigid3& pose, double radius_px,
                          bool scale_radius, int max_distance, Frame* frame) const {
  std::vector<uint8_t> used(frame->points.size()), already(map.Points().size(), 0);
  for (size_t i = 0; i < used.size(); ++i) {
    used[i] = frame->points[i] >= 0;
    if (used[i]) already[frame->points[i]] = 1;
  }
  const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
  const Eigen::Vector3d center = pose.Center();
  // Two points may claim one feature: the nearer descriptor keeps it.
  std::vector<int> claimed_distance(frame->points.size(), kBeyondAnyDistance);
  std::vector<int> claimed(frame->points.size(), -1);
  for (const int index : points) {
    const WorkingPoint& point = map.Point(index);
    if (point.removed || already[index]) continue;
    const Eigen::Vector3d x = R * point.position + pose.translation;
    if (x.z() <= 0) continue;
    const Eigen::Vector2d pixel = camera_.Project(x);
    if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= camera_.width || pixel.y() >= camera_.height) continue;
    const Eigen::Vector3d to_camera = center - point.position;
    const double distance = to_camera.norm();
    if (to_camera.dot(point.normal) < options_.min_view_cos * distance) continue;
    const int octave = map.PredictOctave(point, distance);
    GuidedSearch search;
    search.radius = static_cast<float>(radius_px * (scale_radius ? pyramid_.Scale(octave) : 1.0));
    search.min_octave = octave - options_.octaves_below;
    search.max_octave = octave + options_.octaves_above;
    search.max_distance = max_distance;
    search.ratio = scale_radius ? options_.local_ratio : options_.motion_ratio;
    const Match match = FindNear(frame->features, frame->grid, pixel.cast<float>(), point.descriptor, search, used);
    if (match.b < 0 || match.distance >= claimed_distance[match.b]) continue;
    claimed_distance[match.b] = match.distance;
    claimed[match.b] = index;
  }
  int count = 0;
  for (size_t i = 0; i < claimed.size(); ++i) {
    if (claimed[i] < 0) continue;
    frame->points[i] = claimed[i];
    ++count;
  }
  return count;
}

// One for each feature that has a point, in their order.
std::vector<PoseObservation> Tracker::Observations(const WorkingMap& map, const Frame& frame) const {
  std::vector<PoseObservation> observations;
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (frame.points[i] < 0) continue;
    const Keypoint& keypoint = frame.features.keypoints[i];
    observations.push_back(
        {map.Point(frame.points[i]).position, keypoint.pixel.cast<double>(), pyramid_.Sigma(keypoint.octave)});
  }
  return observations;
}

bool Tracker::Optimize(const WorkingMap& map, const Rigid3& initial, Frame* frame, int* num_inliers) const {
  const PoseOptimizationResult result = OptimizePose(camera_, initial, Observations(map, *frame), options_.pose);
  *num_inliers = result.success ? result.num_inliers : 0;
  if (!result.success) return false;
  size_t i = 0;
  for (int& point : frame->points) {
    if (point >= 0 && !result.inlier[i++]) point = -1;
  }
  frame->cam_from_submap = result.cam_from_world;
  return true;
}

bool Tracker::MatchKeyframe(const WorkingMap& map, int keyframe, Frame* frame) const {
  const Frame& reference = *map.Keyframe(keyframe).frame;
  std::vector<int> with_point;
  for (size_t i = 0; i < reference.points.size(); ++i) {
    if (reference.points[i] >= 0) with_point.push_back(static_cast<int>(i));
  }
  if (static_cast<int>(with_point.size()) < options_.min_motion_matches) return false;
  const std::vector<Match> matches =
      MatchBruteForce(reference.features, frame->features, options_.matching, with_point);
  if (static_cast<int>(matches.size()) < options_.min_motion_matches) return false;
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  std::vector<double> sigmas;
  for (const Match& m : matches) {
    points.push_back(map.Point(reference.points[m.a]).position);
    pixels.push_back(frame->features.keypoints[m.b].pixel.cast<double>());
    sigmas.push_back(pyramid_.Sigma(frame->features.keypoints[m.b].octave));
  }
  PnpOptions pnp_options = options_.pnp;
  pnp_options.seed = options_.seed;
  const PnpResult pnp = SolvePnpRansac(camera_, points, pixels, sigmas, pnp_options);
  const double min_inliers = options_.min_descriptor_share * options_.min_motion_matches;
  if (!pnp.success || pnp.num_inliers < min_inliers) return false;
  std::fill(frame->points.begin(), frame->points.end(), -1);
  for (size_t i = 0; i < matches.size(); ++i) {
    if (pnp.inlier[i]) frame->points[matches[i].b] = reference.points[matches[i].a];
  }
  int num_inliers = 0;
  return Optimize(map, pnp.cam_from_world, frame, &num_inliers) && num_inliers >= min_inliers;
}

std::vector<int> Tracker::LocalKeyframes(const WorkingMap& map, const std::vector<int>& seeds,
                                         const Frame& frame) const {
  std::vector<int> votes(map.Keyframes().size(), 0);
  for (const int p : frame.points) {
    if (p < 0) continue;
    for (const WorkingObservation& o : map.Point(p).observations) ++votes[o.keyframe];
  }
  std::vector<int> order;
  for (int k = static_cast<int>(votes.size()) - 1; k >= 0; --k) {
    if (votes[k] > 0) order.push_back(k);
  }
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return votes[a] > votes[b]; });
  if (order.empty()) order = seeds;
  std::vector<int> local(order.begin(), order.begin() + std::min<size_t>(order.size(), options_.max_local_keyframes));
  std::set<int> chosen(local.begin(), local.end());
  for (size_t i = 0; i < std::min<size_t>(options_.num_expanded, order.size()); ++i) {
    int added = 0;
    for (const Covisible& c : map.CovisibleKeyframes(order[i], options_.min_shared_points)) {
      if (static_cast<int>(local.size()) >= options_.max_local_keyframes || added >= options_.max_neighbours) break;
      if (chosen.insert(c.keyframe).second) local.push_back(c.keyframe), ++added;
    }
  }
  return local;
}

TrackResult Tracker::Track(const std::optional<Rigid3>& prediction, const std::vector<int>& hints, WorkingMap* map,
                           Frame* frame) const {
  TrackResult result;
  result.reason = LossReason::kTooFewMatches;
  frame->points.assign(frame->features.Size(), -1);
  bool found = false;
  if (prediction) {
    const StageTimer timer("track/motion");
    const std::vector<int> points = map->PointsOf(LocalKeyframes(*map, hints, *frame));
    for (const double factor : {1.0, options_.wide_factor}) {
      std::fill(frame->points.begin(), frame->points.end(), -1);
      const int count = SearchPoints(*map, points, *prediction, factor * options_.motion_radius * camera_.width, false,
                                     options_.motion_max_distance, frame);
      int inliers = 0;
      if (count >= options_.min_motion_matches && Optimize(*map, *prediction, frame, &inliers) &&
          inliers >= options_.min_motion_matches && inliers >= options_.min_motion_share * count) {
        found = true;
        result.method = factor == 1.0 ? TrackMethod::kMotion : TrackMethod::kWide;
        break;
      }
    }
  }
  for (size_t i = 0; i < hints.size() && !found; ++i) {
    const StageTimer timer("track/descriptors");
    std::fill(frame->points.begin(), frame->points.end(), -1);
    if (MatchKeyframe(*map, hints[i], frame)) {
      found = true;
      result.method = TrackMethod::kDescriptors;
    }
  }
  if (!found) {
    std::fill(frame->points.begin(), frame->points.end(), -1);
    return result;
  }
  result.reason = LossReason::kTooFewInliers;
  const StageTimer timer("track/local_map");
  // The local map: everything that should be in view now. Twice, because the second time the pose is better.
  std::vector<int> points;
  for (int round = 0; round < 2; ++round) {
    points = map->PointsOf(LocalKeyframes(*map, hints, *frame));
    SearchPoints(*map, points, frame->cam_from_submap, options_.local_radius_px, true, options_.local_max_distance,
                 frame);
    if (!Optimize(*map, frame->cam_from_submap, frame, &result.num_inliers)) break;
  }
  result.spread = Spread(*frame, camera_);
  const std::vector<int> visible = VisiblePoints(*map, points, frame->cam_from_submap);
  result.num_visible = static_cast<int>(visible.size());
  const bool is_enough = result.num_inliers >= options_.min_inliers && result.spread >= options_.min_spread;
  const bool is_predicted = result.method != TrackMethod::kDescriptors;
  const double max_sigma = options_.max_position_sigma * (is_predicted ? options_.predicted_sigma_factor : 1);
  // A wrong pose finds the few points that made it, and none of the others that should be in view; or those that it
  // finds would as well be seen from elsewhere.
  if (is_enough)
    result.position_sigma = RelativePositionSigma(camera_, frame->cam_from_submap, Observations(*map, *frame));
  if (!is_enough || result.num_inliers < options_.min_found_share * result.num_visible ||
      result.position_sigma > max_sigma) {
    if (is_enough) result.reason = LossReason::kUnsupportedPose;
    std::fill(frame->points.begin(), frame->points.end(), -1);
    return result;
  }
  // Bookkeeping for culling: what should have been seen, and what was.
  for (const int index : visible) ++map->MutablePoint(index)->visible;
  std::vector<int> votes(map->Keyframes().size(), 0);
  for (const int p : frame->points) {
    if (p < 0) continue;
    ++map->MutablePoint(p)->found;
    for (const WorkingObservation& o : map->Point(p).observations) ++votes[o.keyframe];
  }
  for (size_t k = 0; k < votes.size(); ++k) {
    if (result.reference_keyframe < 0 || votes[k] >= votes[result.reference_keyframe]) {
      result.reference_keyframe = static_cast<int>(k);
    }
  }
  result.success = true;
  result.reason = LossReason::kNone;
  return result;
}

TrackResult Tracker::TrackAfterwards(const std::vector<int>& hints, WorkingMap* map, Frame* frame) const {
  TrackResult result = Track(std::nullopt, hints, map, frame);
  if (result.success && (result.spread < options_.min_spread_afterwards ||
                         result.position_sigma > options_.max_position_sigma_afterwards)) {
    result.success = false;
    std::fill(frame->points.begin(), frame->points.end(), -1);
  }
  return result;
}

}  // namespace mapmend
