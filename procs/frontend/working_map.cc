#include "procs/frontend/working_map.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace mapmend {

int WorkingMap::NumPoints() const {
  return static_cast<int>(
      std::count_if(points_.begin(), points_.end(), [](const WorkingPoint& p) { return !p.removed; }));
}

int WorkingMap::AddKeyframe(const FramePtr& frame) {
  const int index = static_cast<int>(keyframes_.size());
  keyframes_.push_back({});
  keyframes_.back().id = KeyframeId(ids_->next_keyframe++);
  keyframes_.back().frame = frame;
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
  MarkDirty(index);
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
  points_[point].descriptor_current = false;
  keyframes_[keyframe].dirty_features.push_back(feature);
}

void WorkingMap::RemoveObservation(int point, int keyframe) {
  auto& observations = points_[point].observations;
  const auto at = std::find_if(observations.begin(), observations.end(),
                               [&](const WorkingObservation& o) { return o.keyframe == keyframe; });
  if (at == observations.end()) return;
  keyframes_[keyframe].frame->points[at->feature] = -1;
  keyframes_[keyframe].dirty_features.push_back(at->feature);
  observations.erase(at);
  points_[point].descriptor_current = false;
  if (observations.size() < 2) RemovePoint(point);
}

void WorkingMap::RemovePoint(int point) {
  WorkingPoint& p = points_[point];
  if (p.removed) return;
  for (const WorkingObservation& o : p.observations) {
    keyframes_[o.keyframe].frame->points[o.feature] = -1;
    keyframes_[o.keyframe].dirty_features.push_back(o.feature);
  }
  p.observations.clear();
  p.removed = true;
  if (p.published) removed_points_.push_back(p.id);
  p.published = false;
}

void WorkingMap::RemoveKeyframe(int keyframe) {
  WorkingKeyframe& k = keyframes_[keyframe];
  for (const int p : PointsOf(keyframe)) RemoveObservation(p, keyframe);
  k.removed = true;
  k.dirty_features.clear();
  dirty_keyframes_.erase(keyframe);
  removed_keyframes_.push_back(k.id);
  // Others may still hold the frame.
  const auto kept = std::make_shared<Frame>();
  kept->index = k.frame->index;
  kept->utime = k.frame->utime;
  kept->cam_from_submap = k.frame->cam_from_submap;
  k.frame = kept;
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
  MarkDirty(point);
}

void WorkingMap::MarkDirty(int point) {
  if (!points_[point].dirty) dirty_points_.push_back(point);
  points_[point].dirty = true;
}

// The descriptor with the least median distance to the others; the latest few observations suffice.
void WorkingMap::ChooseDescriptor(WorkingPoint* point) const {
  constexpr int kMaxCompared = 12;
  const int count = std::min(kMaxCompared, static_cast<int>(point->observations.size()));
  const WorkingObservation* observations = point->observations.data() + (point->observations.size() - count);
  const auto descriptor = [&](int i) -> const Descriptor& {
    return keyframes_[observations[i].keyframe].frame->features.descriptors[observations[i].feature];
  };
  int distances[kMaxCompared][kMaxCompared];  // of i to the others; the place of i itself is left out
  for (int i = 0; i < count; ++i) {
    for (int j = i + 1; j < count; ++j) {
      distances[i][j - 1] = distances[j][i] = HammingDistance(descriptor(i), descriptor(j));
    }
  }
  int best_median = 257;
  for (int i = 0; i < count; ++i) {
    const int others = count - 1;
    std::nth_element(distances[i], distances[i] + others / 2, distances[i] + others);
    const int median = others > 0 ? distances[i][others / 2] : 0;
    if (median < best_median) {
      best_median = median;
      point->descriptor = descriptor(i);
    }
  }
  point->descriptor_current = true;
}

void WorkingMap::RefreshPoint(int point) {
  WorkingPoint& p = points_[point];
  if (p.removed || p.observations.empty()) return;
  if (!p.descriptor_current) ChooseDescriptor(&p);
  p.normal.setZero();
  for (const WorkingObservation& o : p.observations) {
    p.normal += (keyframes_[o.keyframe].frame->cam_from_submap.Center() - p.position).normalized();
  }
  p.normal.normalize();
  const WorkingObservation& reference = p.observations.back();
  const Frame& frame = *keyframes_[reference.keyframe].frame;
  p.max_distance =
      (frame.cam_from_submap * p.position).norm() * pyramid_.Scale(frame.features.keypoints[reference.feature].octave);
}

std::vector<int> WorkingMap::PointsOf(int keyframe) const {
  std::vector<int> points;
  for (const int p : keyframes_[keyframe].frame->points) {
    if (p >= 0) points.push_back(p);
  }
  std::sort(points.begin(), points.end());
  return points;
}

std::vector<int> WorkingMap::PointsOf(const std::vector<int>& keyframes) const {
  constexpr size_t kBits = 64;
  std::vector<uint64_t> seen(points_.size() / kBits + 1, 0);
  size_t count = 0;
  for (const int k : keyframes) {
    for (const int p : keyframes_[k].frame->points) {
      if (p < 0) continue;
      uint64_t& word = seen[static_cast<size_t>(p) / kBits];
      const uint64_t bit = uint64_t{1} << (static_cast<size_t>(p) % kBits);
      count += (word & bit) == 0;
      word |= bit;
    }
  }
  std::vector<int> points;
  points.reserve(count);
  for (size_t i = 0; i < seen.size(); ++i) {
    for (uint64_t word = seen[i]; word != 0; word &= word - 1)
      points.push_back(static_cast<int>(i * kBits) + std::countr_zero(word));
  }
  return points;
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
    if (frame.points[i] >= 0 && points_[frame.points[i]].published) ids[i] = points_[frame.points[i]].id;
  }
  return ids;
}

void WorkingMap::MarkPublished(int keyframe) {
  WorkingKeyframe& k = keyframes_[keyframe];
  k.published = true;
  dirty_keyframes_.erase(keyframe);
  // What the keyframe itself told need not be told again.
  std::erase_if(k.dirty_features, [&](int feature) {
    const int point = k.frame->points[feature];
    return point < 0 || points_[point].published;
  });
}

MapUpdate WorkingMap::TakeUpdate() {
  MapUpdate update;
  update.submap = id_;
  for (const int k : dirty_keyframes_) {
    if (keyframes_[k].published) update.keyframes.push_back({keyframes_[k].id, keyframes_[k].frame->cam_from_submap});
  }
  std::sort(dirty_points_.begin(), dirty_points_.end());
  for (const int p : dirty_points_) {
    points_[p].dirty = false;
    if (points_[p].removed) continue;
    update.points.push_back({points_[p].id, points_[p].position.cast<float>()});
    points_[p].published = true;
  }
  for (WorkingKeyframe& k : keyframes_) {
    std::sort(k.dirty_features.begin(), k.dirty_features.end());
    k.dirty_features.erase(std::unique(k.dirty_features.begin(), k.dirty_features.end()), k.dirty_features.end());
    if (k.published) {
      for (const int feature : k.dirty_features) {
        const int point = k.frame->points[feature];
        update.observations.push_back({k.id, feature, point >= 0 ? points_[point].id : MapPointId()});
      }
    }
    k.dirty_features.clear();
  }
  update.removed_keyframes = std::move(removed_keyframes_);
  removed_keyframes_.clear();
  update.removed_points = std::move(removed_points_);
  removed_points_.clear();
  dirty_keyframes_.clear();
  dirty_points_.clear();
  return update;
}

}  // namespace mapmend
