#include "procs/frontend/local_mapper.h"

#include <algorithm>
#include <set>

#include "libs/optim/bundle_adjustment.h"
#include "procs/frontend/profiler.h"
#include "procs/frontend/view_prediction.h"

namespace mapmend {
namespace {

// Twentieths of the known depths that are left out on either side.
constexpr size_t kDepthParts = 20;
// Never culled:
constexpr int kNumInitial = 2;  // keyframes: the pair that gave the submap its frame and scale
constexpr int kNewest = 3;      // keyframes: tracking matches with them

}  // namespace

void LocalMapper::Process(KeyframeIndex keyframe, WorkingMap* map, MapLock* lock) {
  CullRecentPoints(keyframe, map);
  for (const PointIndex p : map->PointsOf(keyframe)) map->RefreshPoint(p);
  std::vector<KeyframeIndex> neighbours;
  for (const Covisible& c : map->CovisibleKeyframes(keyframe, options_.min_covisible)) {
    if (static_cast<int>(neighbours.size()) >= options_.num_neighbours) break;
    neighbours.push_back(c.keyframe);
  }
  GiveWay(lock);
  overlap_fusion_.Fuse(keyframe, neighbours, map);
  Triangulate(keyframe, neighbours, map, lock);
  FuseNeighbourhood(keyframe, neighbours, map, lock);
  bundle_.AdjustAround(keyframe, map, lock);
  CullKeyframes(keyframe, map);
}

void LocalMapper::FuseNeighbourhood(KeyframeIndex keyframe, const std::vector<KeyframeIndex>& neighbours,
                                    WorkingMap* map, MapLock* lock) const {
  const StageTimer timer("map/fuse");
  std::vector<KeyframeIndex> targets = neighbours;
  std::set<KeyframeIndex> seen(neighbours.begin(), neighbours.end());
  seen.insert(keyframe);
  for (size_t i = 0; i < std::min<size_t>(options_.num_expanded, neighbours.size()); ++i) {
    int added = 0;
    for (const Covisible& c : map->CovisibleKeyframes(neighbours[i], options_.expanded_min_covisible)) {
      if (added >= options_.expanded_neighbours) break;
      if (seen.insert(c.keyframe).second) targets.push_back(c.keyframe), ++added;
    }
  }
  const std::vector<PointIndex> own = map->PointsOf(keyframe);
  for (const KeyframeIndex k : targets) {
    FuseInto(k, own, map);
    GiveWay(lock);
  }
  FuseInto(keyframe, map->PointsOf(targets), map);
  for (const PointIndex p : map->PointsOf(keyframe)) map->RefreshPoint(p);
}

void LocalMapper::CullRecentPoints(KeyframeIndex keyframe, WorkingMap* map) const {
  const StageTimer timer("map/cull");
  if (map->Keyframe(keyframe).frame->photo) return;  // few points of sparse photos are seen more than twice
  const int num_points = static_cast<int>(map->Points().size());
  for (PointIndex i(0); i < num_points; ++i) {
    const WorkingPoint& point = map->Point(i);
    if (point.removed) continue;
    const int age = keyframe - point.first_keyframe;
    if (age > options_.probation_keyframes || age < 1) continue;
    const bool rarely_found = point.found < options_.min_found_share * point.visible;
    const bool not_confirmed =
        age >= options_.probation_keyframes && static_cast<int>(point.observations.size()) < options_.min_observations;
    if (rarely_found || not_confirmed) map->RemovePoint(i);
  }
}

void LocalMapper::CullKeyframes(KeyframeIndex keyframe, WorkingMap* map) const {
  const StageTimer timer("map/cull");
  for (const Covisible& c : map->CovisibleKeyframes(keyframe, options_.min_covisible)) {
    if (c.keyframe < kNumInitial || c.keyframe > keyframe - kNewest || !map->Keyframe(c.keyframe).published) continue;
    if (IsRedundant(c.keyframe, *map)) map->RemoveKeyframe(c.keyframe);
  }
}

bool LocalMapper::IsRedundant(KeyframeIndex keyframe, const WorkingMap& map) const {
  const WorkingKeyframe& judged = map.Keyframe(keyframe);
  int num_points = 0, num_redundant = 0;
  for (size_t i = 0; i < judged.points.size(); ++i) {
    if (judged.points[i].IsNone()) continue;
    ++num_points;
    const int coarsest = judged.frame->features.keypoints[i].octave + 1;
    int observers = -1;  // not counting itself
    for (const WorkingObservation& o : map.Point(judged.points[i]).observations) {
      if (map.Keyframe(o.keyframe).frame->features.keypoints[o.feature].octave <= coarsest) ++observers;
      if (observers == options_.redundant_observers) break;
    }
    num_redundant += observers == options_.redundant_observers;
  }
  return num_redundant > options_.redundant_share * num_points;
}

void LocalMapper::Triangulate(KeyframeIndex keyframe, const std::vector<KeyframeIndex>& neighbours, WorkingMap* map,
                              MapLock* lock) const {
  const StageTimer timer("map/triangulate");
  std::vector<double> depths;
  for (const PointIndex p : map->Keyframe(keyframe).points) {
    if (!p.IsNone()) depths.push_back((map->Keyframe(keyframe).cam_from_submap * map->Point(p).position).z());
  }
  if (static_cast<int>(depths.size()) < options_.min_depths) return;
  std::sort(depths.begin(), depths.end());
  const DepthRange range = {options_.nearest_depth * depths[depths.size() / kDepthParts],
                            options_.farthest_depth * depths[depths.size() * (kDepthParts - 1) / kDepthParts]};
  for (const KeyframeIndex neighbour : neighbours) {
    // Anew each time: keyframes may have joined the map.
    const WorkingKeyframe &a = map->Keyframe(keyframe), &b = map->Keyframe(neighbour);
    const double baseline = (b.cam_from_submap.Center() - a.cam_from_submap.Center()).norm();
    if (baseline < options_.min_baseline * depths[depths.size() / 2]) continue;
    for (const NewPoint& p : triangulation_.FindPoints(a, b, range)) {
      const PointIndex point = map->AddPoint(p.position, keyframe);
      map->AddObservation(point, neighbour, p.feature_b);
      map->AddObservation(point, keyframe, p.feature_a);
      map->RefreshPoint(point);
    }
    GiveWay(lock);
  }
}

void LocalMapper::FuseInto(KeyframeIndex keyframe, const std::vector<PointIndex>& points, WorkingMap* map) const {
  static const std::vector<uint8_t> kNoneUsed;
  const WorkingKeyframe& into = map->Keyframe(keyframe);
  const Features& features = into.frame->features;
  std::vector<uint8_t> is_own(map->Points().size(), 0);
  for (const PointIndex p : into.points) {
    if (!p.IsNone()) is_own[p] = 1;
  }
  const Viewpoint viewpoint(camera_, into.cam_from_submap);
  for (const PointIndex index : points) {
    const WorkingPoint& point = map->Point(index);
    if (point.removed || is_own[index]) continue;
    const std::optional<PredictedView> view = PredictView(viewpoint, point, options_.min_view_cos);
    if (!view) continue;
    const int octave = map->PredictOctave(point, view->distance);
    GuidedSearch search;
    search.radius = static_cast<float>(options_.fuse_radius_px * pyramid_.Scale(octave));
    search.min_octave = octave - options_.octave_tolerance;
    search.max_octave = octave + options_.octave_tolerance;
    search.max_distance = options_.max_distance;
    search.ratio = 1.0;  // no second best: the window is small, and two points at one place are what is looked for
    const FeatureIndex feature(
        FindNear(features, into.frame->grid, view->pixel.cast<float>(), point.descriptor, search, kNoneUsed).b);
    if (feature.IsNone()) continue;
    const Keypoint& keypoint = features.keypoints[feature];
    if (ReprojectionChi2(camera_, into.cam_from_submap, point.position, keypoint.pixel.cast<double>(),
                         pyramid_.Sigma(keypoint.octave)) > options_.fuse_chi2_factor * options_.outlier_chi2) {
      continue;
    }
    const PointIndex existing = into.points[feature];
    if (existing.IsNone()) {
      map->AddObservation(index, keyframe, feature);
    } else if (map->Point(existing).observations.size() > point.observations.size()) {
      map->FusePoints(index, existing);
    } else {
      map->FusePoints(existing, index);
    }
  }
}

}  // namespace mapmend
