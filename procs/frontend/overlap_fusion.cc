#include "procs/frontend/overlap_fusion.h"

#include <algorithm>
#include <iterator>
#include <set>

#include "procs/frontend/profiler.h"
#include "procs/frontend/view_prediction.h"

namespace mapmend {
namespace {

// Of the points that a keyframe sees, which must be some.
double MedianDepth(const WorkingKeyframe& keyframe, const WorkingMap& map) {
  std::vector<double> depths;
  for (const PointIndex p : keyframe.points) {
    if (!p.IsNone()) depths.push_back((keyframe.cam_from_submap * map.Point(p).position).z());
  }
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  return depths[depths.size() / 2];
}

// Unit vector in the submap frame.
Eigen::Vector3d OpticalAxis(const Rigid3& cam_from_submap) {
  return cam_from_submap.rotation.conjugate() * Eigen::Vector3d::UnitZ();
}

}  // namespace

void OverlapFusion::Fuse(KeyframeIndex keyframe, const std::vector<KeyframeIndex>& neighbours, WorkingMap* map) const {
  const StageTimer timer("map/overlap");
  const WorkingKeyframe& own = map->Keyframe(keyframe);
  const std::vector<PointIndex> own_points = map->PointsOf(keyframe);
  if (own_points.empty()) return;
  const std::vector<PointIndex> theirs = map->PointsOf(Overlapping(keyframe, neighbours, MedianDepth(own, *map), *map));
  std::vector<PointIndex> points;
  std::set_difference(theirs.begin(), theirs.end(), own_points.begin(), own_points.end(), std::back_inserter(points));
  if (static_cast<int>(points.size()) < options_.overlap_min_points) return;
  const auto [matches, observations] = Search(own, points, *map);
  if (static_cast<int>(matches.size()) < options_.overlap_min_agreeing) return;
  const PoseOptimizationResult agreed = OptimizePose(camera_, own.cam_from_submap, observations, options_.pose);
  if (!agreed.success || agreed.num_inliers < options_.overlap_min_agreeing ||
      agreed.num_inliers < options_.overlap_agreeing_share * static_cast<double>(matches.size())) {
    return;
  }
  for (size_t i = 0; i < matches.size(); ++i) {
    const auto [point, feature] = matches[i];
    if (!agreed.inlier[i] || map->Point(point).removed) continue;
    const PointIndex existing = own.points[feature];
    if (existing.IsNone()) {
      map->AddObservation(point, keyframe, feature);
    } else if (existing != point) {
      // The older point stays: it is held by the strip that is finished.
      map->FusePoints(existing, point);
    }
  }
}

std::vector<KeyframeIndex> OverlapFusion::Overlapping(KeyframeIndex keyframe,
                                                      const std::vector<KeyframeIndex>& neighbours, double depth,
                                                      const WorkingMap& map) const {
  const Rigid3& own = map.Keyframe(keyframe).cam_from_submap;
  const Eigen::Vector3d axis = OpticalAxis(own);
  const Eigen::Vector3d looked_at = own.Center() + depth * axis;
  const std::set<KeyframeIndex> known(neighbours.begin(), neighbours.end());
  struct Candidate {
    double offset = 0;  // pixels
    KeyframeIndex keyframe;
  };
  std::vector<Candidate> candidates;
  for (KeyframeIndex k(0); k < keyframe; ++k) {
    if (map.Keyframe(k).removed || known.contains(k)) continue;
    const Rigid3& other = map.Keyframe(k).cam_from_submap;
    const Eigen::Vector3d x = other * looked_at;
    if (x.z() < options_.overlap_min_depth * depth || x.z() > options_.overlap_max_depth * depth ||
        OpticalAxis(other).dot(axis) < options_.overlap_min_axis_cos)
      continue;
    const double offset = (camera_.Project(x) - Eigen::Vector2d(camera_.cx, camera_.cy)).norm();
    if (offset < options_.overlap_max_offset * camera_.width) candidates.push_back({offset, k});
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.offset < b.offset; });
  if (static_cast<int>(candidates.size()) > options_.max_overlapping_keyframes) {
    candidates.resize(options_.max_overlapping_keyframes);
  }
  std::vector<KeyframeIndex> overlapping;
  overlapping.reserve(candidates.size());
  for (const Candidate& c : candidates) overlapping.push_back(c.keyframe);
  return overlapping;
}

OverlapFusion::Matches OverlapFusion::Search(const WorkingKeyframe& keyframe, const std::vector<PointIndex>& points,
                                             const WorkingMap& map) const {
  static const std::vector<uint8_t> kNoneUsed;
  const Features& features = keyframe.frame->features;
  const Viewpoint viewpoint(camera_, keyframe.cam_from_submap);
  Matches found;
  for (const PointIndex index : points) {
    const WorkingPoint& point = map.Point(index);
    const std::optional<PredictedView> view = PredictView(viewpoint, point, kFromAnyDirection);
    if (!view) continue;
    const int octave = map.PredictOctave(point, view->distance);
    GuidedSearch search;
    search.radius = static_cast<float>(options_.overlap_radius * camera_.width);
    search.min_octave = octave - options_.octave_tolerance;
    search.max_octave = octave + options_.octave_tolerance;
    search.max_distance = options_.max_distance;
    search.ratio = options_.overlap_ratio;
    const FeatureIndex feature(
        FindNear(features, keyframe.frame->grid, view->pixel.cast<float>(), point.descriptor, search, kNoneUsed).b);
    if (feature.IsNone()) continue;
    const Keypoint& keypoint = features.keypoints[feature];
    found.matches.push_back({index, feature});
    found.observations.push_back({point.position, keypoint.pixel.cast<double>(), pyramid_.Sigma(keypoint.octave)});
  }
  return found;
}

}  // namespace mapmend
