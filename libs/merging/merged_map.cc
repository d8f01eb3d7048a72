#include "libs/merging/merged_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <unordered_set>

namespace mapmend {
namespace {

// Per feature: where in submap.points the map point is that it observes, -1 without. A point has one place in a
// keyframe: of features that observe the same the first counts.
std::vector<int> PlacesOfPoints(const Submap& submap, const SubmapKeyframe& keyframe) {
  std::vector<int> places;
  places.reserve(keyframe.map_points.size());
  std::unordered_set<MapPointId> seen;
  for (const MapPointId id : keyframe.map_points) {
    const auto point = id.IsValid() ? submap.points.find(id) : submap.points.end();
    const bool is_first = point != submap.points.end() && seen.insert(id).second;
    places.push_back(is_first ? static_cast<int>(point - submap.points.begin()) : -1);
  }
  return places;
}

// Adds the points of a submap that two of its keyframes see or more, without tracks. `places`: where in submap.points
// what its features observe is, per keyframe and feature, -1 without; becomes the indices of the points added.
void AddPoints(int submap, const Similarity3& root_from_submap, std::span<std::vector<int>> places, MergedMap* map) {
  const SortedMap<MapPointId, SubmapPoint>& points = map->submaps[submap].submap->points;
  std::vector<int> num_keyframes(points.size(), 0), index(points.size(), -1);
  for (const std::vector<int>& of_keyframe : places) {
    for (const int place : of_keyframe) {
      if (place >= 0) ++num_keyframes[place];
    }
  }
  size_t place = 0;
  for (const auto& [id, point] : points) {
    if (num_keyframes[place] >= 2) {
      index[place] = static_cast<int>(map->points.size());
      map->points.push_back(
          {root_from_submap * point.position.cast<double>(), Track(num_keyframes[place]), {submap, id}, {}});
    }
    ++place;
  }
  for (std::vector<int>& of_keyframe : places) {
    for (int& p : of_keyframe) p = p < 0 ? -1 : index[p];
  }
}

// Octave in which a feature is as uncertain as this, pixels.
int OctaveOf(const Pyramid& pyramid, double sigma) {
  int best = 0;
  for (int octave = 1; octave < pyramid.num_levels; ++octave) {
    if (std::abs(std::log(pyramid.Sigma(octave) / sigma)) < std::abs(std::log(pyramid.Sigma(best) / sigma)))
      best = octave;
  }
  return best;
}

}  // namespace

Eigen::Vector2d MergedMap::ShutterCorrection(const TrackElement& element, const Eigen::Vector3d& x_cam) const {
  const MergedKeyframe& keyframe = keyframes[element.keyframe];
  const SubmapView& view = submaps[keyframe.submap];
  const Eigen::Vector2d pixel = element.pixel.cast<double>();
  return mapmend::ShutterCorrection(view.camera, keyframe.motion, x_cam / keyframe.scale,
                                    LinePlace(view.camera, view.real, pixel, shutters[keyframe.submap].lines));
}

Eigen::Vector2d MergedMap::Pixel(const TrackElement& element, const Eigen::Vector3d& x_cam) const {
  const MergedKeyframe& keyframe = keyframes[element.keyframe];
  const Eigen::Vector2d pixel = element.pixel.cast<double>();
  const double readout = shutters[keyframe.submap].readout;
  return readout == 0 ? pixel : Eigen::Vector2d(pixel + readout * ShutterCorrection(element, x_cam));
}

double MergedMap::SquaredError(const MergedPoint& point, const TrackElement& element) const {
  const MergedKeyframe& keyframe = keyframes[element.keyframe];
  const Eigen::Vector3d x = keyframe.cam_from_root * point.position;
  if (!(x.z() > 0)) return std::numeric_limits<double>::infinity();
  const double sigma = Sigma(element);
  return (CameraOf(element.keyframe).Project(x) - Pixel(element, x)).squaredNorm() / (sigma * sigma);
}

int MergedMap::FindKeyframe(int submap, KeyframeId id) const {
  const auto it = std::lower_bound(keyframes.begin(), keyframes.end(), std::pair(submap, id),
                                   [](const MergedKeyframe& k, const std::pair<int, KeyframeId>& key) {
                                     return std::pair(k.submap, k.keyframe->id) < key;
                                   });
  if (it == keyframes.end() || it->submap != submap || it->keyframe->id != id) return -1;
  return static_cast<int>(it - keyframes.begin());
}

MergedMap MakeMergedMap(const std::vector<SubmapView>& submaps, const std::vector<Similarity3>& root_from_submap,
                        const OpenFeatureSource& open_features) {
  MergedMap map;
  map.submaps = submaps;
  map.shutters.resize(submaps.size());
  size_t num_points = 0;
  for (const SubmapView& view : submaps) num_points += view.submap->points.size();
  map.points.reserve(num_points);
  for (int s = 0; s < static_cast<int>(submaps.size()); ++s) {
    const size_t first_keyframe = map.keyframes.size();
    const Submap& submap = *submaps[s].submap;
    for (const auto& [id, keyframe] : submap.keyframes) {
      map.keyframes.push_back(
          {s, &keyframe, TransformWorld(keyframe.cam_from_submap, root_from_submap[s]), root_from_submap[s].scale});
      map.point_of_feature.push_back(PlacesOfPoints(submap, keyframe));
    }
    AddPoints(s, root_from_submap[s], std::span(map.point_of_feature).subspan(first_keyframe), &map);
  }
  FeatureReader reader(open_features);
  std::vector<uint32_t> length(map.points.size(), 0);
  for (int k = 0; k < static_cast<int>(map.keyframes.size()); ++k) {
    const auto features = reader.Read(map.keyframes[k].submap, *map.keyframes[k].keyframe);
    for (int f = 0; f < features->Size(); ++f) {
      const int p = map.point_of_feature[k][f];
      if (p < 0) continue;
      TrackElement& element = map.points[p].track[length[p]++];
      element.keyframe = k;
      element.feature = f;
      element.SetPlace(features->keypoints[f]);
    }
  }
  return map;
}

void MeasureMotions(MergedMap* map) {
  size_t k = 0;
  for (const SubmapView& view : map->submaps) {
    for (const CameraMotion& motion : KeyframeMotions(*view.submap)) map->keyframes[k++].motion = motion;
  }
}

void MovePointsWithKeyframes(const std::vector<MergedKeyframe>& before, MergedMap* map) {
  std::vector<Similarity3> moved;
  for (size_t k = 0; k < before.size(); ++k) {
    moved.push_back(map->keyframes[k].RootFromCam() * before[k].RootFromCam().Inverse());
  }
  for (MergedPoint& point : map->points) {
    if (!point.track.empty()) point.position = moved[point.track.front().keyframe] * point.position;
  }
}

bool FusePoints(int into, int from, MergedMap* map) {
  MergedPoint &a = map->points[into], &b = map->points[from];
  if (into == from || a.track.empty() || b.track.empty()) return false;
  for (size_t i = 0, j = 0; i < a.track.size() && j < b.track.size();) {
    if (a.track[i].keyframe == b.track[j].keyframe) return false;
    if (a.track[i].keyframe < b.track[j].keyframe)
      ++i;
    else
      ++j;
  }
  const double wa = static_cast<double>(a.track.size()), wb = static_cast<double>(b.track.size());
  a.position = (wa * a.position + wb * b.position) / (wa + wb);
  for (const TrackElement& e : b.track) map->point_of_feature[e.keyframe][e.feature] = into;
  Track track(a.track.size() + b.track.size());
  std::merge(a.track.begin(), a.track.end(), b.track.begin(), b.track.end(), track.begin());
  a.track = std::move(track);
  CompactVector<std::pair<int, MapPointId>> fused(a.fused.size() + b.fused.size() + 1);
  std::merge(a.fused.begin(), a.fused.end(), b.fused.begin(), b.fused.end(), fused.begin());
  fused[fused.size() - 1] = std::max(a.first, b.first);
  std::sort(fused.begin(), fused.end());
  a.fused = std::move(fused);
  a.first = std::min(a.first, b.first);
  b.track = {};
  b.fused = {};
  return true;
}

bool AddToTrack(int point, const TrackElement& element, MergedMap* map) {
  MergedPoint& p = map->points[point];
  int& slot = map->point_of_feature[element.keyframe][element.feature];
  if (slot >= 0) return false;
  const auto at = std::lower_bound(p.track.begin(), p.track.end(), element.keyframe,
                                   [](const TrackElement& e, int k) { return e.keyframe < k; });
  if (at != p.track.end() && at->keyframe == element.keyframe) return false;
  p.track.insert(at, element);
  slot = point;
  return true;
}

void AddWidePoints(const WideCommonPoints& points, int submap_a, int submap_b, MergedMap* map) {
  map->num_wide.resize(map->keyframes.size(), 0);
  const auto root_from_a = [&](int keyframe) {
    const MergedKeyframe& k = map->keyframes[keyframe];
    return k.RootFromCam() * Similarity3(k.keyframe->cam_from_submap);
  };
  for (size_t i = 0; i < points.in_a.size(); ++i) {
    std::vector<TrackElement> track;
    int seen_by_a = -1;
    bool is_seen_by_b = false;
    for (const WideCommonPoints::Sighting& s : points.sightings[i]) {
      const int keyframe = map->FindKeyframe(s.is_in_b ? submap_b : submap_a, s.keyframe);
      if (keyframe < 0) continue;
      if (s.is_in_b) {
        is_seen_by_b = true;
      } else {
        seen_by_a = keyframe;
      }
      TrackElement& element = track.emplace_back();
      element.keyframe = keyframe;
      element.octave = OctaveOf(map->PyramidOf(keyframe), s.sigma);
      element.pixel = s.pixel;
    }
    if (seen_by_a < 0 || !is_seen_by_b) continue;
    for (TrackElement& element : track) element.feature = -2 - map->num_wide[element.keyframe]++;
    std::sort(track.begin(), track.end());
    MergedPoint& point = map->points.emplace_back();
    point.position = root_from_a(seen_by_a) * points.in_a[i];
    point.track = Track(track.size());
    std::copy(track.begin(), track.end(), point.track.begin());
    point.first = {submap_a, MapPointId()};
  }
}

void RemoveFromTrack(int point, TrackElement element, MergedMap* map) {
  map->points[point].track.EraseIf([&](const TrackElement& e) { return e == element; });
  if (element.feature >= 0) map->point_of_feature[element.keyframe][element.feature] = -1;
}

ReprojectionStatistics MeasureReprojection(const MergedMap& map) {
  ReprojectionStatistics statistics;
  std::vector<double> errors;
  for (const MergedPoint& point : map.points) {
    for (const TrackElement& e : point.track) {
      const double squared = map.SquaredError(point, e);
      statistics.mean_robust += std::min(squared, 25.0);
      errors.push_back(std::sqrt(squared) * map.Sigma(e));
    }
  }
  statistics.num_observations = static_cast<int>(errors.size());
  if (errors.empty()) return statistics;
  statistics.mean_robust /= static_cast<double>(errors.size());
  const auto middle = errors.begin() + static_cast<long>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  statistics.median_px = *middle;
  return statistics;
}

}  // namespace mapmend
