#include "libs/merging/merged_bundle_adjustment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>

#include "libs/base/text_format.h"
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

// Longest tracks first, until every keyframe has enough. Ties: lower index.
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

// One unknown per flight.
void AddReadouts(const MergedMap& map, BundleProblem* problem) {
  std::map<std::string, int> flights;
  for (size_t s = 0; s < map.submaps.size(); ++s) {
    const auto [it, is_new] = flights.try_emplace(map.submaps[s].flight, static_cast<int>(flights.size()));
    problem->readout_of_camera.push_back(it->second);
    if (is_new) problem->readouts.push_back(map.readouts[s]);
  }
}

bool AreTaken(const std::vector<double>& readouts, const BundleSummary& bundle, const MergedBundleOptions& options) {
  const auto is_plausible = [&](double t) { return std::abs(t) <= options.max_readout; };
  const auto is_noticeable = [&](double t) { return std::abs(t) >= options.min_readout; };
  const double drop = bundle.initial_cost - bundle.final_cost;
  return drop >= options.min_gain * bundle.initial_cost && drop >= options.min_drop &&
         std::all_of(readouts.begin(), readouts.end(), is_plausible) &&
         std::any_of(readouts.begin(), readouts.end(), is_noticeable);
}

// For people.
std::string ReadoutsInText(const std::vector<double>& readouts) {
  std::string text;
  for (const double t : readouts) text += Format("%s%.1f ms", text.empty() ? "" : ", ", 1e3 * t);
  return text;
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

MergedBundleSummary AdjustMergedMap(const MergedBundleOptions& options, MergedMap* map, const std::vector<int>* window,
                                    const std::vector<PositionPrior>* positions) {
  MergedBundleSummary summary;
  std::vector<char> is_free(map->keyframes.size(), window == nullptr),
      is_touched(map->points.size(), window == nullptr);
  if (window) {
    for (const int k : *window) is_free[k] = 1;
    for (size_t i = 0; i < is_touched.size(); ++i) {
      const auto& track = map->points[i].track;
      is_touched[i] =
          std::any_of(track.begin(), track.end(), [&](const TrackElement& e) { return is_free[e.keyframe]; });
    }
  }
  const bool has_positions = positions != nullptr && !positions->empty();
  if (!has_positions) is_free[0] = 0;
  const std::vector<char> selected = SelectPoints(*map, options.points_per_keyframe);
  BundleProblem problem;
  for (const SubmapView& submap : map->submaps) problem.cameras.push_back(submap.camera);
  if (options.find_readouts) AddReadouts(*map, &problem);
  for (size_t k = 0; k < map->keyframes.size(); ++k) {
    problem.poses.push_back({map->keyframes[k].cam_from_root, !is_free[k], map->keyframes[k].submap});
  }
  std::vector<int> index;
  for (size_t i = 0; i < map->points.size(); ++i) {
    if (!selected[i] || !is_touched[i]) continue;
    for (const TrackElement& e : map->points[i].track) {
      const Eigen::Vector3d x = map->keyframes[e.keyframe].cam_from_root * map->points[i].position;
      Eigen::Vector2d pixel = e.pixel.cast<double>();
      if (!options.find_readouts) {
        pixel = map->Pixel(e, x);
      } else {
        problem.shutter_correction.push_back(map->ShutterCorrection(e, x).cast<float>());
      }
      problem.observations.push_back({e.keyframe, static_cast<int>(index.size()), pixel, map->Sigma(e)});
    }
    index.push_back(static_cast<int>(i));
    problem.points.push_back(map->points[i].position);
  }
  summary.num_points = static_cast<int>(index.size());
  summary.num_observations = static_cast<int>(problem.observations.size());
  const BundleSummary bundle = BundleAdjuster().Adjust(options.bundle, &problem, has_positions ? positions : nullptr);
  summary.success = bundle.success;
  summary.num_iterations = bundle.iterations;
  summary.initial_cost = bundle.initial_cost;
  summary.final_cost = bundle.final_cost;
  if (!bundle.success) return summary;
  if (options.find_readouts) {
    summary.reason = ReadoutsInText(problem.readouts);
    summary.success = AreTaken(problem.readouts, bundle, options);
    if (!summary.success) {
      summary.reason += ", not taken";
      return summary;
    }
    for (size_t s = 0; s < map->submaps.size(); ++s) {
      map->readouts[s] = problem.readouts[problem.readout_of_camera[s]];
    }
  }
  const std::vector<MergedKeyframe> before = map->keyframes;
  for (size_t k = 0; k < map->keyframes.size(); ++k) {
    if (is_free[k]) map->keyframes[k].cam_from_root = problem.poses[k].cam_from_world;
  }
  // Points left out move with their keyframes first, then each finds its own place.
  std::vector<char> others(map->points.size(), 0);
  for (size_t i = 0; i < others.size(); ++i) others[i] = is_touched[i] && !selected[i];
  MovePointsWithKeyframes(before, map);
  for (size_t i = 0; i < index.size(); ++i) map->points[index[i]].position = problem.points[i];
  RefinePoints(map, &others);
  summary.num_removed = RemoveOutliers(options.outlier_squared_error, is_touched, map);
  MeasureScales(map);
  return summary;
}

}  // namespace mapmend
