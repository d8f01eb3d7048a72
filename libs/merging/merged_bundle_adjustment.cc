#include "libs/merging/merged_bundle_adjustment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "libs/geometry/chi_square.h"
#include "libs/optim/bundle_adjuster.h"
#include "libs/optim/position_prior.h"
#include "libs/optim/reprojection_cost.h"

namespace mapmend {
namespace {

constexpr double kHuber = kChi2Dof95;

double PointCost(const MergedMap& map, const MergedPoint& point) {
  double cost = 0;
  for (const TrackElement& e : point.track) {
    const double squared = map.SquaredError(point, e);
    if (!std::isfinite(squared)) return squared;
    cost += squared <= kHuber * kHuber ? squared : 2 * kHuber * std::sqrt(squared) - kHuber * kHuber;
  }
  return cost;
}

void RefinePoint(const MergedMap& map, MergedPoint* point) {
  double cost = PointCost(map, *point);
  if (!std::isfinite(cost)) return;
  for (int iteration = 0; iteration < 8; ++iteration) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (const TrackElement& e : point->track) {
      const MergedKeyframe& keyframe = map.keyframes[e.keyframe];
      const double sigma = map.Sigma(e);
      const Eigen::Vector3d x = keyframe.cam_from_root * point->position;
      const Eigen::Vector2d r = (map.CameraOf(e.keyframe).Project(x) - map.Pixel(e, x)) / sigma;
      const Eigen::Matrix<double, 2, 3> J =
          ProjectionJacobian(map.CameraOf(e.keyframe), x) * keyframe.cam_from_root.rotation.toRotationMatrix() / sigma;
      const double weight = r.norm() <= kHuber ? 1 : kHuber / r.norm();
      H += weight * J.transpose() * J;
      g += weight * J.transpose() * r;
    }
    H.diagonal() *= 1 + 1e-6;
    const Eigen::Vector3d step = H.ldlt().solve(-g);
    if (!step.allFinite()) return;
    MergedPoint next = *point;
    next.position += step;
    const double next_cost = PointCost(map, next);
    if (!(next_cost < cost)) return;
    const bool done = cost - next_cost < 1e-4 * cost;
    point->position = next.position;
    cost = next_cost;
    if (done) return;
  }
}

// Wide points, then longest tracks first, until every keyframe has enough. Ties: lower index.
std::vector<char> SelectPoints(const MergedMap& map, int per_keyframe) {
  std::vector<char> selected(map.points.size(), 0);
  std::vector<int> order;
  for (size_t i = 0; i < map.points.size(); ++i) {
    if (map.points[i].track.size() >= 2) order.push_back(static_cast<int>(i));
  }
  if (per_keyframe <= 0) {
    for (const int i : order) selected[i] = 1;
    return selected;
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](int l, int r) { return map.points[l].track.size() > map.points[r].track.size(); });
  std::vector<int> count(map.keyframes.size(), 0);
  for (const int i : order) {
    if (!map.points[i].first.second.IsValid()) selected[i] = 1;
    const auto& track = map.points[i].track;
    if (std::none_of(track.begin(), track.end(),
                     [&](const TrackElement& e) { return count[e.keyframe] < per_keyframe; })) {
      continue;
    }
    selected[i] = 1;
    for (const TrackElement& e : track) ++count[e.keyframe];
  }
  return selected;
}

int RemoveOutliers(double max_squared_error, const std::vector<char>& among, MergedMap* map) {
  int removed = 0;
  for (size_t i = 0; i < map->points.size(); ++i) {
    if (!among[i]) continue;
    const Track track = map->points[i].track;
    for (const TrackElement& e : track) {
      if (map->SquaredError(map->points[i], e) <= max_squared_error) continue;
      RemoveFromTrack(static_cast<int>(i), e, map);
      ++removed;
    }
    if (map->points[i].track.size() == 1) RemoveFromTrack(static_cast<int>(i), map->points[i].track.front(), map);
  }
  return removed;
}

}  // namespace

void RefinePoints(MergedMap* map, const std::vector<char>* only) {
  for (size_t i = 0; i < map->points.size(); ++i) {
    if (only && !(*only)[i]) continue;
    if (map->points[i].track.size() >= 2) RefinePoint(*map, &map->points[i]);
  }
}

void MeasureScales(MergedMap* map) {
  std::vector<std::vector<double>> ratios(map->keyframes.size());
  for (const MergedPoint& point : map->points) {
    for (const TrackElement& e : point.track) {
      const MergedKeyframe& keyframe = map->keyframes[e.keyframe];
      if (e.feature < 0) continue;
      const MapPointId id = keyframe.keyframe->map_points[e.feature];
      const Submap& submap = *map->submaps[keyframe.submap].submap;
      const auto raw = id.IsValid() ? submap.points.find(id) : submap.points.end();
      if (raw == submap.points.end()) continue;
      const double depth = (keyframe.keyframe->cam_from_submap * raw->second.position.cast<double>()).z();
      const double merged = (keyframe.cam_from_root * point.position).z();
      if (depth > 0 && merged > 0) ratios[e.keyframe].push_back(merged / depth);
    }
  }
  for (size_t k = 0; k < ratios.size(); ++k) {
    if (ratios[k].empty()) continue;
    const auto middle = ratios[k].begin() + static_cast<long>(ratios[k].size() / 2);
    std::nth_element(ratios[k].begin(), middle, ratios[k].end());
    map->keyframes[k].scale = *middle;
  }
}

MergedBundle MakeMergedBundle(const MergedMap& map, int points_per_keyframe, const std::vector<int>* window,
                              bool hold_first) {
  MergedBundle bundle;
  bundle.is_free.assign(map.keyframes.size(), window == nullptr);
  bundle.is_touched.assign(map.points.size(), window == nullptr);
  if (window) {
    for (const int k : *window) bundle.is_free[k] = 1;
    for (size_t i = 0; i < bundle.is_touched.size(); ++i) {
      const auto& track = map.points[i].track;
      bundle.is_touched[i] =
          std::any_of(track.begin(), track.end(), [&](const TrackElement& e) { return bundle.is_free[e.keyframe]; });
    }
  }
  if (hold_first) bundle.is_free[0] = 0;
  BundleProblem& problem = bundle.problem;
  for (const SubmapView& submap : map.submaps) problem.cameras.push_back(submap.camera);
  for (size_t k = 0; k < map.keyframes.size(); ++k) {
    problem.poses.push_back({map.keyframes[k].cam_from_root, !bundle.is_free[k], map.keyframes[k].submap});
  }
  const std::vector<char> selected = SelectPoints(map, points_per_keyframe);
  for (size_t i = 0; i < map.points.size(); ++i) {
    if (!selected[i] || !bundle.is_touched[i]) continue;
    const int point = static_cast<int>(bundle.points.size());
    for (const TrackElement& e : map.points[i].track) {
      const Eigen::Vector3d x = map.keyframes[e.keyframe].cam_from_root * map.points[i].position;
      problem.observations.push_back({e.keyframe, point, map.Pixel(e, x), map.Sigma(e)});
      bundle.elements.push_back(e);
    }
    bundle.points.push_back(static_cast<int>(i));
    problem.points.push_back(map.points[i].position);
  }
  return bundle;
}

int TakeMergedBundle(const MergedBundle& bundle, double outlier_squared_error, MergedMap* map) {
  const std::vector<MergedKeyframe> before = map->keyframes;
  for (size_t k = 0; k < map->keyframes.size(); ++k) {
    if (bundle.is_free[k]) map->keyframes[k].cam_from_root = bundle.problem.poses[k].cam_from_world;
  }
  MovePointsWithKeyframes(before, map);
  std::vector<char> others = bundle.is_touched;
  for (size_t i = 0; i < bundle.points.size(); ++i) {
    map->points[bundle.points[i]].position = bundle.problem.points[i];
    others[bundle.points[i]] = 0;
  }
  RefinePoints(map, &others);
  const int num_removed = RemoveOutliers(outlier_squared_error, bundle.is_touched, map);
  MeasureScales(map);
  return num_removed;
}

MergedBundleSummary AdjustMergedMap(const MergedBundleOptions& options, MergedMap* map, const std::vector<int>* window,
                                    const std::vector<PositionPrior>* positions) {
  const bool has_positions = positions != nullptr && !positions->empty();
  MergedBundle bundle = MakeMergedBundle(*map, options.points_per_keyframe, window, !has_positions);
  const BundleSummary adjusted =
      BundleAdjuster().Adjust(options.bundle, &bundle.problem, has_positions ? positions : nullptr);
  MergedBundleSummary summary;
  summary.success = adjusted.success;
  summary.num_points = static_cast<int>(bundle.points.size());
  summary.num_observations = static_cast<int>(bundle.elements.size());
  summary.num_iterations = adjusted.iterations;
  summary.initial_cost = adjusted.initial_cost;
  summary.final_cost = adjusted.final_cost;
  if (adjusted.success) summary.num_removed = TakeMergedBundle(bundle, options.outlier_squared_error, map);
  return summary;
}

}  // namespace mapmend
