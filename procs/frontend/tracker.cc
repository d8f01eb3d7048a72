#include "procs/frontend/tracker.h"

#include <algorithm>
#include <set>
#include <utility>

#include "libs/geometry/pnp.h"
#include "libs/optim/bundle_adjustment.h"
#include "libs/optim/pose_uncertainty.h"
#include "procs/frontend/profiler.h"
#include "procs/frontend/view_prediction.h"

namespace mapmend {
namespace {

constexpr int kSpreadColumns = 8, kSpreadRows = 6;  // of the cells that min_spread counts

constexpr int kLocalMapRounds = 2;  // the second time the pose is better

double Spread(const Frame& frame, const std::vector<PointIndex>& points, const Pinhole& camera) {
  std::set<int> cells;
  for (size_t i = 0; i < points.size(); ++i) {
    if (points[i].IsNone()) continue;
    const Eigen::Vector2f& p = frame.features.keypoints[i].pixel;
    const int x = std::clamp(static_cast<int>(p.x() * kSpreadColumns / camera.width), 0, kSpreadColumns - 1);
    const int y = std::clamp(static_cast<int>(p.y() * kSpreadRows / camera.height), 0, kSpreadRows - 1);
    cells.insert(y * kSpreadColumns + x);
  }
  return static_cast<double>(cells.size()) / (kSpreadColumns * kSpreadRows);
}

// How many of the points each keyframe observes.
std::vector<int> SharedPoints(const WorkingMap& map, const std::vector<PointIndex>& points) {
  std::vector<int> shared(map.Keyframes().size(), 0);
  for (const PointIndex p : points) {
    if (p.IsNone()) continue;
    for (const WorkingObservation& o : map.Point(p).observations) ++shared[o.keyframe];
  }
  return shared;
}

// The keyframe that shares most points; ties: the newest.
KeyframeIndex MostShared(const std::vector<int>& shared) {
  KeyframeIndex most;
  for (KeyframeIndex k(0); k < static_cast<int>(shared.size()); ++k) {
    if (most.IsNone() || shared[k] >= shared[most]) most = k;
  }
  return most;
}

TrackResult Failed(TrackResult result, LossReason reason) {
  result.success = false;
  result.reason = reason;
  result.method = TrackMethod::kNone;
  result.points.clear();
  return result;
}

}  // namespace

std::vector<PointIndex> Tracker::VisiblePoints(const WorkingMap& map, const std::vector<PointIndex>& points,
                                               const Rigid3& cam_from_submap) const {
  std::vector<PointIndex> visible;
  const Viewpoint viewpoint(camera_, cam_from_submap);
  for (const PointIndex index : points) {
    const WorkingPoint& point = map.Point(index);
    if (!point.removed && PredictView(viewpoint, point, options_.min_view_cos)) visible.push_back(index);
  }
  return visible;
}

int Tracker::SearchPoints(const WorkingMap& map, const std::vector<PointIndex>& candidates,
                          const Rigid3& cam_from_submap, const Window& window, const Frame& frame,
                          std::vector<PointIndex>* points) const {
  std::vector<uint8_t> used(points->size()), already(map.Points().size(), 0);
  for (size_t i = 0; i < used.size(); ++i) {
    const PointIndex point = (*points)[i];
    used[i] = !point.IsNone();
    if (used[i]) already[point] = 1;
  }
  const Viewpoint viewpoint(camera_, cam_from_submap);
  // Two points may claim one feature: the nearer descriptor keeps it.
  std::vector<int> claimed_distance(points->size(), kBeyondAnyDistance);
  std::vector<PointIndex> claimed(points->size());
  for (const PointIndex index : candidates) {
    const WorkingPoint& point = map.Point(index);
    if (point.removed || already[index]) continue;
    const std::optional<PredictedView> view = PredictView(viewpoint, point, options_.min_view_cos);
    if (!view) continue;
    const int octave = map.PredictOctave(point, view->distance);
    GuidedSearch search;
    search.radius = static_cast<float>(window.radius_px * (window.grows_with_octave ? pyramid_.Scale(octave) : 1.0));
    search.min_octave = octave - options_.octaves_below;
    search.max_octave = octave + options_.octaves_above;
    search.max_distance = window.max_distance;
    search.ratio = window.ratio;
    const Match match = FindNear(frame.features, frame.grid, view->pixel.cast<float>(), point.descriptor, search, used);
    if (match.b < 0 || match.distance >= claimed_distance[match.b]) continue;
    claimed_distance[match.b] = match.distance;
    claimed[match.b] = index;
  }
  int count = 0;
  for (size_t i = 0; i < claimed.size(); ++i) {
    if (claimed[i].IsNone()) continue;
    (*points)[i] = claimed[i];
    ++count;
  }
  return count;
}

// One for each feature that has a point, in their order.
std::vector<PoseObservation> Tracker::Observations(const WorkingMap& map, const Frame& frame,
                                                   const std::vector<PointIndex>& points) const {
  std::vector<PoseObservation> observations;
  for (size_t i = 0; i < points.size(); ++i) {
    if (points[i].IsNone()) continue;
    const Keypoint& keypoint = frame.features.keypoints[i];
    observations.push_back(
        {map.Point(points[i]).position, keypoint.pixel.cast<double>(), pyramid_.Sigma(keypoint.octave)});
  }
  return observations;
}

bool Tracker::Optimize(const WorkingMap& map, const Frame& frame, TrackResult* result) const {
  const PoseOptimizationResult pose =
      OptimizePose(camera_, result->cam_from_submap, Observations(map, frame, result->points), options_.pose);
  result->num_inliers = pose.success ? pose.num_inliers : 0;
  if (!pose.success) return false;
  size_t i = 0;
  for (PointIndex& point : result->points) {
    if (!point.IsNone() && !pose.inlier[i++]) point = PointIndex();
  }
  result->cam_from_submap = pose.cam_from_world;
  return true;
}

bool Tracker::FindAroundPrediction(const Rigid3& prediction, const std::vector<KeyframeIndex>& hints,
                                   const Frame& frame, const WorkingMap& map, TrackResult* result) const {
  const StageTimer timer("track/motion");
  const std::vector<PointIndex> candidates = map.PointsOf(LocalKeyframes(map, hints, {}));
  for (const TrackMethod method : {TrackMethod::kMotion, TrackMethod::kWide}) {
    const double factor = method == TrackMethod::kWide ? options_.wide_factor : 1.0;
    Window window;
    window.radius_px = factor * options_.motion_radius * camera_.width;
    window.max_distance = options_.motion_max_distance;
    window.ratio = options_.motion_ratio;
    result->method = method;
    result->cam_from_submap = prediction;
    result->points.assign(frame.features.Size(), PointIndex());
    const int count = SearchPoints(map, candidates, prediction, window, frame, &result->points);
    if (count >= options_.min_motion_matches && Optimize(map, frame, result) &&
        result->num_inliers >= options_.min_motion_matches &&
        result->num_inliers >= options_.min_motion_share * count) {
      return true;
    }
  }
  return false;
}

bool Tracker::FindByDescriptors(const std::vector<KeyframeIndex>& hints, const Frame& frame, const WorkingMap& map,
                                TrackResult* result) const {
  result->method = TrackMethod::kDescriptors;
  for (const KeyframeIndex hint : hints) {
    const StageTimer timer("track/descriptors");
    if (MatchKeyframe(map.Keyframe(hint), frame, map, result)) return true;
  }
  return false;
}

bool Tracker::MatchKeyframe(const WorkingKeyframe& reference, const Frame& frame, const WorkingMap& map,
                            TrackResult* result) const {
  std::vector<int> with_point;  // features of the keyframe
  for (size_t i = 0; i < reference.points.size(); ++i) {
    if (!reference.points[i].IsNone()) with_point.push_back(static_cast<int>(i));
  }
  if (static_cast<int>(with_point.size()) < options_.min_motion_matches) return false;
  const std::vector<Match> matches =
      MatchBruteForce(reference.frame->features, frame.features, options_.matching, with_point);
  if (static_cast<int>(matches.size()) < options_.min_motion_matches) return false;
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  std::vector<double> sigmas;
  for (const Match& m : matches) {
    points.push_back(map.Point(reference.points[m.a]).position);
    pixels.push_back(frame.features.keypoints[m.b].pixel.cast<double>());
    sigmas.push_back(pyramid_.Sigma(frame.features.keypoints[m.b].octave));
  }
  PnpOptions pnp_options = options_.pnp;
  pnp_options.seed = options_.seed;
  const PnpResult pnp = SolvePnpRansac(camera_, points, pixels, sigmas, pnp_options);
  const double min_inliers = options_.min_descriptor_share * options_.min_motion_matches;
  if (!pnp.success || pnp.num_inliers < min_inliers) return false;
  result->cam_from_submap = pnp.cam_from_world;
  result->points.assign(frame.features.Size(), PointIndex());
  for (size_t i = 0; i < matches.size(); ++i) {
    if (pnp.inlier[i]) result->points[matches[i].b] = reference.points[matches[i].a];
  }
  return Optimize(map, frame, result) && result->num_inliers >= min_inliers;
}

std::vector<KeyframeIndex> Tracker::LocalKeyframes(const WorkingMap& map, const std::vector<KeyframeIndex>& seeds,
                                                   const std::vector<PointIndex>& points) const {
  const std::vector<int> votes = SharedPoints(map, points);
  std::vector<KeyframeIndex> order;
  for (KeyframeIndex k = map.LastKeyframe(); !k.IsNone(); --k) {
    if (votes[k] > 0) order.push_back(k);
  }
  std::stable_sort(order.begin(), order.end(), [&](KeyframeIndex a, KeyframeIndex b) { return votes[a] > votes[b]; });
  if (order.empty()) order = seeds;
  std::vector<KeyframeIndex> local(order.begin(),
                                   order.begin() + std::min<size_t>(order.size(), options_.max_local_keyframes));
  std::set<KeyframeIndex> chosen(local.begin(), local.end());
  for (size_t i = 0; i < std::min<size_t>(options_.num_expanded, order.size()); ++i) {
    int added = 0;
    for (const Covisible& c : map.CovisibleKeyframes(order[i], options_.min_shared_points)) {
      if (static_cast<int>(local.size()) >= options_.max_local_keyframes || added >= options_.max_neighbours) break;
      if (chosen.insert(c.keyframe).second) local.push_back(c.keyframe), ++added;
    }
  }
  return local;
}

std::vector<PointIndex> Tracker::SearchLocalMap(const std::vector<KeyframeIndex>& hints, const Frame& frame,
                                                const WorkingMap& map, TrackResult* result) const {
  Window window;
  window.radius_px = options_.local_radius_px;
  window.grows_with_octave = true;
  window.max_distance = options_.local_max_distance;
  window.ratio = options_.local_ratio;
  std::vector<PointIndex> candidates;
  for (int round = 0; round < kLocalMapRounds; ++round) {
    candidates = map.PointsOf(LocalKeyframes(map, hints, result->points));
    SearchPoints(map, candidates, result->cam_from_submap, window, frame, &result->points);
    if (!Optimize(map, frame, result)) break;
  }
  return VisiblePoints(map, candidates, result->cam_from_submap);
}

// A wrong pose finds the few points that made it, and none of the others that should be in view; or those that it finds
// would as well be seen from elsewhere.
LossReason Tracker::WhyNotBelieved(const Frame& frame, const WorkingMap& map, TrackResult* result) const {
  result->spread = Spread(frame, result->points, camera_);
  if (result->num_inliers < options_.min_inliers || result->spread < options_.min_spread)
    return LossReason::kTooFewInliers;
  result->position_sigma =
      RelativePositionSigma(camera_, result->cam_from_submap, Observations(map, frame, result->points));
  const bool is_predicted = result->method != TrackMethod::kDescriptors;
  const double max_sigma = options_.max_position_sigma * (is_predicted ? options_.predicted_sigma_factor : 1);
  const bool is_unsupported =
      result->num_inliers < options_.min_found_share * result->num_visible || result->position_sigma > max_sigma;
  return is_unsupported ? LossReason::kUnsupportedPose : LossReason::kNone;
}

TrackResult Tracker::Track(const std::optional<Rigid3>& prediction, const std::vector<KeyframeIndex>& hints,
                           const Frame& frame, WorkingMap* map) const {
  TrackResult result;
  const bool is_found = (prediction && FindAroundPrediction(*prediction, hints, frame, *map, &result)) ||
                        FindByDescriptors(hints, frame, *map, &result);
  if (!is_found) return Failed(std::move(result), LossReason::kTooFewMatches);
  const StageTimer timer("track/local_map");
  const std::vector<PointIndex> visible = SearchLocalMap(hints, frame, *map, &result);
  result.num_visible = static_cast<int>(visible.size());
  const LossReason reason = WhyNotBelieved(frame, *map, &result);
  if (reason != LossReason::kNone) return Failed(std::move(result), reason);
  // Bookkeeping for culling: what should have been seen, and what was.
  for (const PointIndex index : visible) ++map->MutablePoint(index)->visible;
  for (const PointIndex index : result.points) {
    if (!index.IsNone()) ++map->MutablePoint(index)->found;
  }
  result.reference_keyframe = MostShared(SharedPoints(*map, result.points));
  result.success = true;
  return result;
}

TrackResult Tracker::TrackAfterwards(const std::vector<KeyframeIndex>& hints, const Frame& frame,
                                     WorkingMap* map) const {
  TrackResult result = Track(std::nullopt, hints, frame, map);
  if (result.success && (result.spread < options_.min_spread_afterwards ||
                         result.position_sigma > options_.max_position_sigma_afterwards)) {
    return Failed(std::move(result), LossReason::kUnsupportedPose);
  }
  return result;
}

}  // namespace mapmend
