#include "procs/frontend/working_map.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace mapmend {

int WorkingMap::NumPoints() const {
  return static_cast<int>(
      std::count_if(points_.begin(), points_.end(), [](const WorkingPoint& p) { return !p.removed; }));
}

KeyframeIndex WorkingMap::AddKeyframe(const FramePtr& frame, const Rigid3& cam_from_submap,
                                      const std::vector<PointIndex>& points) {
  const KeyframeIndex index(static_cast<int>(keyframes_.size()));
  WorkingKeyframe& keyframe = keyframes_.emplace_back();
  keyframe.id = KeyframeId(ids_->next_keyframe++);
  keyframe.frame = frame;
  keyframe.cam_from_submap = cam_from_submap;
  keyframe.points.resize(frame->features.Size());
  const FeatureIndex end(static_cast<int>(points.size()));
  for (FeatureIndex i(0); i < end; ++i) {
    if (!points[i].IsNone() && !points_[points[i]].removed) AddObservation(points[i], index, i);
  }
  return index;
}

PointIndex WorkingMap::AddPoint(const Eigen::Vector3d& position, KeyframeIndex first_keyframe) {
  const PointIndex index(static_cast<int>(points_.size()));
  WorkingPoint point;
  point.id = MapPointId(ids_->next_point++);
  point.position = position;
  point.first_keyframe = first_keyframe;
  points_.push_back(std::move(point));
  MarkDirty(index);
  return index;
}

void WorkingMap::AddObservation(PointIndex point, KeyframeIndex keyframe, FeatureIndex feature) {
  auto& observations = points_[point].observations;
  const auto at = std::lower_bound(observations.begin(), observations.end(), keyframe,
                                   [](const WorkingObservation& o, KeyframeIndex k) { return o.keyframe < k; });
  PointIndex& slot = keyframes_[keyframe].points[feature];
  if ((at != observations.end() && at->keyframe == keyframe) || !slot.IsNone()) return;
  observations.insert(at, {keyframe, feature});
  slot = point;
  points_[point].descriptor_current = false;
  keyframes_[keyframe].dirty_features.push_back(feature);
}

void WorkingMap::RemoveObservation(PointIndex point, KeyframeIndex keyframe) {
  auto& observations = points_[point].observations;
  const auto at = std::find_if(observations.begin(), observations.end(),
                               [&](const WorkingObservation& o) { return o.keyframe == keyframe; });
  if (at == observations.end()) return;
  keyframes_[keyframe].points[at->feature] = PointIndex();
  keyframes_[keyframe].dirty_features.push_back(at->feature);
  observations.erase(at);
  points_[point].descriptor_current = false;
  if (observations.size() < 2) RemovePoint(point);
}

void WorkingMap::RemovePoint(PointIndex point) {
  WorkingPoint& p = points_[point];
  if (p.removed) return;
  for (const WorkingObservation& o : p.observations) {
    keyframes_[o.keyframe].points[o.feature] = PointIndex();
    keyframes_[o.keyframe].dirty_features.push_back(o.feature);
  }
  p.observations.clear();
  p.removed = true;
  if (p.published) removed_points_.push_back(p.id);
  p.published = false;
}

void WorkingMap::RemoveKeyframe(KeyframeIndex keyframe) {
  WorkingKeyframe& k = keyframes_[keyframe];
  for (const PointIndex p : PointsOf(keyframe)) RemoveObservation(p, keyframe);
  k.removed = true;
  k.points.clear();
  k.dirty_features.clear();
  dirty_keyframes_.erase(keyframe);
  removed_keyframes_.push_back(k.id);
  // Others may still hold the frame.
  const auto kept = std::make_shared<Frame>();
  kept->index = k.frame->index;
  kept->utime = k.frame->utime;
  k.frame = kept;
}

void WorkingMap::FusePoints(PointIndex from, PointIndex into) {
  if (from == into || points_[from].removed || points_[into].removed) return;
  const auto moved = points_[from].observations;
  points_[into].visible += points_[from].visible;
  points_[into].found += points_[from].found;
  RemovePoint(from);
  for (const WorkingObservation& o : moved) AddObservation(into, o.keyframe, o.feature);
  RefreshPoint(into);
}

void WorkingMap::SetPose(KeyframeIndex keyframe, const Rigid3& cam_from_submap) {
  keyframes_[keyframe].cam_from_submap = cam_from_submap;
  dirty_keyframes_.insert(keyframe);
}

void WorkingMap::SetPosition(PointIndex point, const Eigen::Vector3d& position) {
  points_[point].position = position;
  MarkDirty(point);
}

void WorkingMap::MarkDirty(PointIndex point) {
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

void WorkingMap::RefreshPoint(PointIndex point) {
  WorkingPoint& p = points_[point];
  if (p.removed || p.observations.empty()) return;
  if (!p.descriptor_current) ChooseDescriptor(&p);
  p.normal.setZero();
  for (const WorkingObservation& o : p.observations) {
    p.normal += (keyframes_[o.keyframe].cam_from_submap.Center() - p.position).normalized();
  }
  p.normal.normalize();
  const WorkingObservation& reference = p.observations.back();
  const WorkingKeyframe& keyframe = keyframes_[reference.keyframe];
  p.max_distance = (keyframe.cam_from_submap * p.position).norm() *
                   pyramid_.Scale(keyframe.frame->features.keypoints[reference.feature].octave);
}

std::vector<PointIndex> WorkingMap::PointsOf(KeyframeIndex keyframe) const {
  std::vector<PointIndex> points;
  for (const PointIndex p : keyframes_[keyframe].points) {
    if (!p.IsNone()) points.push_back(p);
  }
  std::sort(points.begin(), points.end());
  return points;
}

std::vector<PointIndex> WorkingMap::PointsOf(const std::vector<KeyframeIndex>& keyframes) const {
  constexpr size_t kBits = 64;
  std::vector<uint64_t> seen(points_.size() / kBits + 1, 0);
  size_t count = 0;
  for (const KeyframeIndex k : keyframes) {
    for (const PointIndex p : keyframes_[k].points) {
      if (p.IsNone()) continue;
      uint64_t& word = seen[static_cast<size_t>(p) / kBits];
      const uint64_t bit = uint64_t{1} << (static_cast<size_t>(p) % kBits);
      count += (word & bit) == 0;
      word |= bit;
    }
  }
  std::vector<PointIndex> points;
  points.reserve(count);
  for (size_t i = 0; i < seen.size(); ++i) {
    for (uint64_t word = seen[i]; word != 0; word &= word - 1)
      points.emplace_back(static_cast<int>(i * kBits) + std::countr_zero(word));
  }
  return points;
}

std::vector<Covisible> WorkingMap::CovisibleKeyframes(KeyframeIndex keyframe, int min_shared) const {
  std::vector<int> counts(keyframes_.size(), 0);
  for (const PointIndex point : keyframes_[keyframe].points) {
    if (point.IsNone()) continue;
    for (const WorkingObservation& o : points_[point].observations) ++counts[o.keyframe];
  }
  std::vector<Covisible> result;
  for (KeyframeIndex k = LastKeyframe(); !k.IsNone(); --k) {
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

std::vector<MapPointId> WorkingMap::PublishedPoints(KeyframeIndex keyframe) const {
  const std::vector<PointIndex>& points = keyframes_[keyframe].points;
  std::vector<MapPointId> ids(points.size());
  for (size_t i = 0; i < ids.size(); ++i) {
    if (!points[i].IsNone() && points_[points[i]].published) ids[i] = points_[points[i]].id;
  }
  return ids;
}

void WorkingMap::MarkPublished(KeyframeIndex keyframe) {
  WorkingKeyframe& k = keyframes_[keyframe];
  k.published = true;
  dirty_keyframes_.erase(keyframe);
  // What the keyframe itself told need not be told again.
  std::erase_if(k.dirty_features, [&](FeatureIndex feature) {
    const PointIndex point = k.points[feature];
    return point.IsNone() || points_[point].published;
  });
}

MapUpdate WorkingMap::TakeUpdate() {
  MapUpdate update;
  update.submap = id_;
  for (const KeyframeIndex k : dirty_keyframes_) {
    if (keyframes_[k].published) update.keyframes.push_back({keyframes_[k].id, keyframes_[k].cam_from_submap});
  }
  std::sort(dirty_points_.begin(), dirty_points_.end());
  for (const PointIndex p : dirty_points_) {
    points_[p].dirty = false;
    if (points_[p].removed) continue;
    update.points.push_back({points_[p].id, points_[p].position.cast<float>()});
    points_[p].published = true;
  }
  for (WorkingKeyframe& k : keyframes_) {
    std::sort(k.dirty_features.begin(), k.dirty_features.end());
    k.dirty_features.erase(std::unique(k.dirty_features.begin(), k.dirty_features.end()), k.dirty_features.end());
    if (k.published) {
      for (const FeatureIndex feature : k.dirty_features) {
        const PointIndex point = k.points[feature];
        update.observations.push_back({k.id, feature, point.IsNone() ? MapPointId() : points_[point].id});
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
