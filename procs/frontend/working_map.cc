#include "procs/frontend/working_map.h"

#include <algorithm>
#include <cmath>

namespace mapmend {

int WorkingMap::NumPoints() const {
  return static_cast<int>(std::count_if(points_.begin(), points_.end(), [](const WorkingPoint& p) { return !p.removed; }));
}

int WorkingMap::AddKeyframe(const FramePtr& frame) {
  const int index = static_cast<int>(keyframes_.size());
  keyframes_.push_back({KeyframeId(ids_->next_keyframe++), frame, false});
  const std::vector<int> observed = frame->points;
  frame->points.assign(observed.size(), -1);
  for (size_t i = 0; i < observed.size(); ++i) {
    if (observed[i] >= 0 && !points_[observed[i]].removed) AddObservation(observed[i], index, static_cast<int>(i));
  }
  return index;
}

int WorkingMap::AddPoint(const Eigen::Vector3d& position, int first_keyframe) {
  const int index = static_cast<int>(points_.size());
  WorkingPoint point;
  point.id = MapPointId(ids_->next_point++);
  point.position = position;
  point.first_keyframe = first_keyframe;
  points_.push_back(std::move(point));
  dirty_points_.insert(index);
  return index;
}

void WorkingMap::AddObservation(int point, int keyframe, int feature) {
  auto& observations = points_[point].observations;
  const auto at = std::lower_bound(observations.begin(), observations.end(), keyframe,
                                   [](const WorkingObservation& o, int k) { return o.keyframe < k; });
  int& slot = keyframes_[keyframe].frame->points[feature];
  if ((at != observations.end() && at->keyframe == keyframe) || slot >= 0) return;
  observations.insert(at, {keyframe, feature});
  slot = point;
  dirty_observations_.insert({keyframe, feature});
}

void WorkingMap::RemoveObservation(int point, int keyframe) {
  auto& observations = points_[point].observations;
  const auto at = std::find_if(observations.begin(), observations.end(),
                               [&](const WorkingObservation& o) { return o.keyframe == keyframe; });
  if (at == observations.end()) return;
  keyframes_[keyframe].frame->points[at->feature] = -1;
  dirty_observations_.insert({keyframe, at->feature});
  observations.erase(at);
  if (observations.size() < 2) RemovePoint(point);
}

void WorkingMap::RemovePoint(int point) {
  WorkingPoint& p = points_[point];
  if (p.removed) return;
  for (const WorkingObservation& o : p.observations) {
    keyframes_[o.keyframe].frame->points[o.feature] = -1;
    dirty_observations_.insert({o.keyframe, o.feature});
  }
  p.observations.clear();
  p.removed = true;
  dirty_points_.erase(point);
  if (published_points_.erase(point) > 0) removed_points_.push_back(p.id);
}

void WorkingMap::RemoveKeyframe(int keyframe) {
  WorkingKeyframe& k = keyframes_[keyframe];
  if (k.removed) return;
  for (size_t i = 0; i < k.frame->points.size(); ++i) {
    if (k.frame->points[i] >= 0) RemoveObservation(k.frame->points[i], keyframe);
  }
  k.removed = true;
  if (published_keyframes_.erase(keyframe) > 0) removed_keyframes_.push_back(k.id);
}

void WorkingMap::FusePoints(int from, int into) {
  if (from == into || points_[from].removed || points_[into].removed) return;
  const auto moved = points_[from].observations;
  points_[into].visible += points_[from].visible;
  points_[into].found += points_[from].found;
  RemovePoint(from);
  for (const WorkingObservation& o : moved) AddObservation(into, o.keyframe, o.feature);
  RefreshPoint(into);
}

void WorkingMap::SetPose(int keyframe, const Rigid3& cam_from_submap) {
  keyframes_[keyframe].frame->cam_from_submap = cam_from_submap;
  dirty_keyframes_.insert(keyframe);
}

void WorkingMap::SetPosition(int point, const Eigen::Vector3d& position) {
  points_[point].position = position;
  dirty_points_.insert(point);
}

void WorkingMap::RefreshPoint(int point) {
  WorkingPoint& p = points_[point];
  if (p.removed || p.observations.empty()) return;
  const auto descriptor = [&](const WorkingObservation& o) -> const Descriptor& {
    return keyframes_[o.keyframe].frame->features.descriptors[o.feature];
  };
  // The descriptor with the least median distance to the others; the latest few observations suffice.
  constexpr size_t kMaxCompared = 12;
  const size_t begin = p.observations.size() > kMaxCompared ? p.observations.size() - kMaxCompared : 0;
  int best_median = 257;
  for (size_t i = begin; i < p.observations.size(); ++i) {
    std::vector<int> distances;
    for (size_t j = begin; j < p.observations.size(); ++j) {
      if (i != j) distances.push_back(HammingDistance(descriptor(p.observations[i]), descriptor(p.observations[j])));
    }
    int median = 0;
    if (!distances.empty()) {
      std::nth_element(distances.begin(), distances.begin() + distances.size() / 2, distances.end());
      median = distances[distances.size() / 2];
    }
    if (median < best_median) {
      best_median = median;
      p.descriptor = descriptor(p.observations[i]);
    }
  }
  p.normal.setZero();
  for (const WorkingObservation& o : p.observations) {
    p.normal += (keyframes_[o.keyframe].frame->cam_from_submap.Center() - p.position).normalized();
  }
  p.normal.normalize();
  const WorkingObservation& reference = p.observations.back();
  const Frame& frame = *keyframes_[reference.keyframe].frame;
  p.max_distance = (frame.cam_from_submap * p.position).norm() *
                   pyramid_.Scale(frame.features.keypoints[reference.feature].octave);
}

std::vector<Covisible> WorkingMap::CovisibleKeyframes(int keyframe, int min_shared) const {
  std::vector<int> counts(keyframes_.size(), 0);
  for (const int point : keyframes_[keyframe].frame->points) {
    if (point < 0) continue;
    for (const WorkingObservation& o : points_[point].observations) ++counts[o.keyframe];
  }
  std::vector<Covisible> result;
  for (int k = static_cast<int>(counts.size()) - 1; k >= 0; --k) {
    if (k != keyframe && counts[k] >= min_shared) result.push_back({k, counts[k]});
  }
  std::stable_sort(result.begin(), result.end(),
                   [](const Covisible& a, const Covisible& b) { return a.shared_points > b.shared_points; });
  return result;
}

int WorkingMap::PredictOctave(const WorkingPoint& point, double distance) const {
  const double octave = std::log(point.max_distance / distance) / std::log(pyramid_.scale_factor);
  return static_cast<int>(std::clamp(std::lround(octave), 0L, static_cast<long>(pyramid_.num_levels - 1)));
}

std::vector<MapPointId> WorkingMap::PublishedPoints(int keyframe) const {
  const Frame& frame = *keyframes_[keyframe].frame;
  std::vector<MapPointId> ids(frame.points.size());
  for (size_t i = 0; i < ids.size(); ++i) {
    if (frame.points[i] >= 0 && published_points_.contains(frame.points[i])) ids[i] = points_[frame.points[i]].id;
  }
  return ids;
}

void WorkingMap::MarkPublished(int keyframe) {
  published_keyframes_.insert(keyframe);
  dirty_keyframes_.erase(keyframe);
  const Frame& frame = *keyframes_[keyframe].frame;
  for (size_t i = 0; i < frame.points.size(); ++i) {
    const int feature = static_cast<int>(i);
    if (frame.points[i] >= 0 && published_points_.contains(frame.points[i])) {
      dirty_observations_.erase({keyframe, feature});
    } else if (frame.points[i] < 0) {
      dirty_observations_.erase({keyframe, feature});
    }
  }
}

MapUpdate WorkingMap::TakeUpdate() {
  MapUpdate update;
  update.submap = id_;
  for (const int k : dirty_keyframes_) {
    if (published_keyframes_.contains(k)) update.keyframes.push_back({keyframes_[k].id, keyframes_[k].frame->cam_from_submap});
  }
  for (const int p : dirty_points_) {
    update.points.push_back({points_[p].id, points_[p].position.cast<float>()});
    published_points_.insert(p);
  }
  for (const auto& [keyframe, feature] : dirty_observations_) {
    if (!published_keyframes_.contains(keyframe)) continue;
    const int point = keyframes_[keyframe].frame->points[feature];
    update.observations.push_back({keyframes_[keyframe].id, feature, point >= 0 ? points_[point].id : MapPointId()});
  }
  update.removed_keyframes = std::move(removed_keyframes_);
  update.removed_points = std::move(removed_points_);
  removed_keyframes_.clear();
  removed_points_.clear();
  dirty_keyframes_.clear();
  dirty_points_.clear();
  dirty_observations_.clear();
  return update;
}

}  // namespace mapmend
