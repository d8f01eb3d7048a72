#include "libs/mapping/merged_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapmend {

Eigen::Vector2d MergedMap::ShutterCorrection(const TrackElement& element, const Eigen::Vector3d& x_cam) const {
  const MergedKeyframe& keyframe = keyframes[element.keyframe];
  const SubmapView& view = submaps[keyframe.submap];
  const Eigen::Vector2d pixel = keyframe.keyframe->features.keypoints[element.feature].pixel.cast<double>();
  return mapmend::ShutterCorrection(view.camera, keyframe.motion, x_cam / keyframe.scale,
                                    RowHeight(view.camera, view.real, pixel));
}

Eigen::Vector2d MergedMap::Pixel(const TrackElement& element, const Eigen::Vector3d& x_cam) const {
  const MergedKeyframe& keyframe = keyframes[element.keyframe];
  const Eigen::Vector2d pixel = keyframe.keyframe->features.keypoints[element.feature].pixel.cast<double>();
  const double readout = readouts[keyframe.submap];
  return readout == 0 ? pixel : Eigen::Vector2d(pixel + readout * ShutterCorrection(element, x_cam));
}

double MergedMap::SquaredError(const MergedPoint& point, const TrackElement& element) const {
  const MergedKeyframe& keyframe = keyframes[element.keyframe];
  const Eigen::Vector3d x = keyframe.cam_from_root * point.position;
  if (!(x.z() > 0)) return std::numeric_limits<double>::infinity();
  const Keypoint& keypoint = keyframe.keyframe->features.keypoints[element.feature];
  const double sigma = PyramidOf(element.keyframe).Sigma(keypoint.octave);
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

MergedMap MakeMergedMap(const std::vector<SubmapView>& submaps, const std::vector<Similarity3>& root_from_submap) {
  MergedMap map;
  map.submaps = submaps;
  map.readouts.assign(submaps.size(), 0);
  size_t num_points = 0;
  for (const SubmapView& view : submaps) num_points += view.submap->points.size();
  map.points.reserve(num_points);
  for (int s = 0; s < static_cast<int>(submaps.size()); ++s) {
    const int first_keyframe = static_cast<int>(map.keyframes.size());
    std::map<KeyframeId, int> index_of;
    const std::vector<CameraMotion> motions = KeyframeMotions(*submaps[s].submap);
    for (const auto& [id, keyframe] : submaps[s].submap->keyframes) {
      const CameraMotion& motion = motions[index_of.size()];
      index_of[id] = first_keyframe + static_cast<int>(index_of.size());
      map.keyframes.push_back({s, &keyframe, TransformWorld(keyframe.cam_from_submap, root_from_submap[s]),
                               root_from_submap[s].scale, motion});
      map.point_of_feature.emplace_back(keyframe.features.Size(), -1);
    }
    for (const auto& [id, point] : submaps[s].submap->points) {
      if (point.observations.size() < 2) continue;
      MergedPoint merged{root_from_submap[s] * point.position, {}, {s, id}, {}};
      merged.track.reserve(point.observations.size());
      for (const SubmapObservation& o : point.observations) {
        const int k = index_of.at(o.keyframe);
        if (!merged.track.empty() && merged.track.back().keyframe == k) continue;
        merged.track.push_back({k, o.feature});
        map.point_of_feature[k][o.feature] = static_cast<int>(map.points.size());
      }
      map.points.push_back(std::move(merged));
    }
  }
  return map;
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
  std::vector<TrackElement> track;
  std::merge(a.track.begin(), a.track.end(), b.track.begin(), b.track.end(), std::back_inserter(track));
  a.track = std::move(track);
  a.fused.insert(a.fused.end(), b.fused.begin(), b.fused.end());
  a.fused.push_back(std::max(a.first, b.first));
  a.first = std::min(a.first, b.first);
  std::sort(a.fused.begin(), a.fused.end());
  std::vector<TrackElement>().swap(b.track);
  std::vector<std::pair<int, MapPointId>>().swap(b.fused);
  return true;
}

bool AddToTrack(int point, const TrackElement& element, MergedMap* map) {
  MergedPoint& p = map->points[point];
  int& slot = map->point_of_feature[element.keyframe][element.feature];
  if (slot >= 0) return false;
  const auto at = std::lower_bound(p.track.begin(), p.track.end(), TrackElement{element.keyframe, -1});
  if (at != p.track.end() && at->keyframe == element.keyframe) return false;
  p.track.insert(at, element);
  slot = point;
  return true;
}

void RemoveFromTrack(int point, const TrackElement& element, MergedMap* map) {
  std::erase(map->points[point].track, element);
  map->point_of_feature[element.keyframe][element.feature] = -1;
}

ReprojectionStatistics MeasureReprojection(const MergedMap& map) {
  ReprojectionStatistics statistics;
  std::vector<double> errors;
  for (const MergedPoint& point : map.points) {
    for (const TrackElement& e : point.track) {
      const double squared = map.SquaredError(point, e);
      statistics.mean_robust += std::min(squared, 25.0);
      const Keypoint& keypoint = map.keyframes[e.keyframe].keyframe->features.keypoints[e.feature];
      errors.push_back(std::sqrt(squared) * map.PyramidOf(e.keyframe).Sigma(keypoint.octave));
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
