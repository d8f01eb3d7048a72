#include "libs/stream/submap.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <set>
#include <unordered_set>

namespace mapmend {
namespace {

constexpr size_t kMaxFeatures = 1 << 20;  // of a keyframe; far more than an image has, and few enough for 24 bits

bool IsFinite(const Rigid3& t) { return t.translation.allFinite() && t.rotation.coeffs().allFinite(); }

void RemoveObservation(Submap* submap, MapPointId point, KeyframeId keyframe, int feature) {
  const auto it = submap->points.find(point);
  if (it == submap->points.end()) return;
  it->second.observations.EraseIf(
      [&](const SubmapObservation& o) { return o.keyframe == keyframe && o.feature == feature; });
}

void AddObservation(SubmapPoint* point, KeyframeId keyframe, int feature) {
  const auto at = std::lower_bound(point->observations.begin(), point->observations.end(), keyframe,
                                   [](const SubmapObservation& o, KeyframeId id) { return o.keyframe < id; });
  if (at != point->observations.end() && at->keyframe == keyframe && at->feature == feature) return;
  point->observations.insert(at, {keyframe, feature});
}

// Checks a whole update before any of it is applied, so that a bad record leaves the submap as it was.
std::string CheckUpdate(const Submap& submap, const MapUpdate& update) {
  const auto has_keyframe = [&](KeyframeId id) { return submap.keyframes.contains(id); };
  for (const auto& [keyframe, pose] : update.keyframes) {
    if (!has_keyframe(keyframe)) return "map update: unknown keyframe " + std::to_string(keyframe.value);
    if (!IsFinite(pose)) return "map update: pose of keyframe " + std::to_string(keyframe.value) + " is not finite";
  }
  std::unordered_set<MapPointId> new_points;
  for (const PointPosition& p : update.points) {
    if (!p.point.IsValid() || !p.position.allFinite())
      return "map update: bad map point " + std::to_string(p.point.value);
    new_points.insert(p.point);
  }
  for (const ObservationChange& o : update.observations) {
    const auto it = submap.keyframes.find(o.keyframe);
    if (it == submap.keyframes.end())
      return "map update: observation in unknown keyframe " + std::to_string(o.keyframe.value);
    if (o.feature < 0 || o.feature >= static_cast<int>(it->second.map_points.size()))
      return "map update: feature index out of range";
    if (o.point.IsValid() && !submap.points.contains(o.point) && !new_points.contains(o.point)) {
      return "map update: observation of unknown map point " + std::to_string(o.point.value);
    }
  }
  std::set<KeyframeId> removed;
  for (const KeyframeId id : update.removed_keyframes) {
    if (has_keyframe(id)) removed.insert(id);
  }
  if (!removed.empty() && removed.size() == submap.keyframes.size()) return "map update: removes the last keyframe";
  for (const TrackedFrame& f : update.frames) {
    if (!has_keyframe(f.keyframe) && !submap.removed_keyframes.contains(f.keyframe)) {
      return "map update: frame refers to unknown keyframe " + std::to_string(f.keyframe.value);
    }
    if (!IsFinite(f.cam_from_keyframe)) return "map update: frame pose is not finite";
  }
  return "";
}

// Of the other keyframes the one that shares most map points (ties: nearest by id, then the older); without any the one
// before, or behind.
const SubmapKeyframe& Successor(const Submap& submap, std::map<KeyframeId, SubmapKeyframe>::const_iterator keyframe) {
  const CompactVector<SharingKeyframe> shared = submap.CountShared(keyframe->second);
  const auto is_worse = [&](const SharingKeyframe& l, const SharingKeyframe& r) {
    const auto away = [&](KeyframeId id) { return std::abs(id.value - keyframe->first.value); };
    return l.num_points != r.num_points ? l.num_points < r.num_points : away(l.keyframe) > away(r.keyframe);
  };
  const auto best = std::max_element(shared.begin(), shared.end(), is_worse);
  if (best != shared.end()) return submap.keyframes.at(best->keyframe);
  return keyframe != submap.keyframes.begin() ? std::prev(keyframe)->second : std::next(keyframe)->second;
}

void ApplyUpdate(Submap* submap, const MapUpdate& update) {
  for (const auto& [keyframe, pose] : update.keyframes) submap->keyframes.at(keyframe).cam_from_submap = pose;
  for (const PointPosition& p : update.points) {
    SubmapPoint& point = submap->points[p.point];
    point.id = p.point;
    point.position = p.position;
  }
  for (const ObservationChange& o : update.observations) {
    MapPointId& slot = submap->keyframes.at(o.keyframe).map_points[o.feature];
    if (slot.IsValid()) RemoveObservation(submap, slot, o.keyframe, o.feature);
    slot = o.point;
    if (o.point.IsValid()) AddObservation(&submap->points.at(o.point), o.keyframe, o.feature);
  }
  for (const KeyframeId id : update.removed_keyframes) {
    const auto it = submap->keyframes.find(id);
    if (it == submap->keyframes.end()) continue;
    const SubmapKeyframe& successor = Successor(*submap, it);
    submap->removed_keyframes[id] = {successor.id, it->second.cam_from_submap * successor.cam_from_submap.Inverse()};
    for (size_t i = 0; i < it->second.map_points.size(); ++i) {
      const MapPointId point = it->second.map_points[i];
      if (point.IsValid()) RemoveObservation(submap, point, id, static_cast<int>(i));
    }
    submap->keyframes.erase(it);
  }
  for (const MapPointId id : update.removed_points) {
    const auto it = submap->points.find(id);
    if (it == submap->points.end()) continue;
    for (const SubmapObservation& o : it->second.observations) {
      submap->keyframes.at(o.keyframe).map_points[o.feature] = MapPointId();
    }
  }
  submap->points.EraseAll(update.removed_points);
  submap->frames.insert(submap->frames.end(), update.frames.begin(), update.frames.end());
}

std::string ApplyKeyframe(Submap* submap, const RecordHeader& header, const KeyframeRecord& record) {
  const size_t n = record.features.keypoints.size();
  if (record.features.descriptors.size() != n || record.map_points.size() != n || record.words.size() != n ||
      record.nodes.size() != n) {
    return "keyframe: feature counts disagree";
  }
  if (n > kMaxFeatures) return "keyframe: too many features";
  if (!IsFinite(record.cam_from_submap)) return "keyframe: pose is not finite";
  if (!record.keyframe.IsValid() || submap->keyframes.contains(record.keyframe) ||
      submap->removed_keyframes.contains(record.keyframe))
    return "keyframe: id used before";
  for (const MapPointId id : record.map_points) {
    if (id.IsValid() && !submap->points.contains(id)) return "keyframe: unknown map point " + std::to_string(id.value);
  }
  SubmapKeyframe& keyframe = submap->keyframes[record.keyframe];
  keyframe = {record.keyframe,
              header.utime,
              record.frame,
              header.seq,
              record.cam_from_submap,
              record.features,
              record.words,
              record.nodes,
              record.bow,
              record.map_points,
              {}};
  for (size_t i = 0; i < n; ++i) {
    if (record.map_points[i].IsValid()) {
      AddObservation(&submap->points.at(record.map_points[i]), record.keyframe, static_cast<int>(i));
    }
  }
  return "";
}

// Whether there is such a keyframe is not asked: who holds no more than an ended submap's outline takes the record too.
std::string ApplyWide(Submap* submap, const RecordHeader& header, const WideFeaturesRecord& record) {
  if (record.features.keypoints.size() != record.features.descriptors.size())
    return "wide features: feature counts disagree";
  if (record.features.keypoints.size() > kMaxFeatures) return "wide features: too many";
  const bool is_keyframe = record.keyframe.IsValid();
  if (!is_keyframe && record.frame < 0) return "wide features: of nothing";
  if (is_keyframe ? submap->wide.contains(record.keyframe) : submap->wide_between.contains(record.frame))
    return "wide features: told before";
  SubmapWideFeatures& wide = is_keyframe ? submap->wide[record.keyframe] : submap->wide_between[record.frame];
  wide = {header.seq, header.utime, std::make_shared<const WideFeatures>(record.features)};
  return "";
}

}  // namespace

TrackedFrame Submap::Resolved(TrackedFrame frame) const {
  while (!keyframes.contains(frame.keyframe)) {
    const RemovedKeyframe& removed = removed_keyframes.at(frame.keyframe);
    frame.cam_from_keyframe = frame.cam_from_keyframe * removed.cam_from_successor;
    frame.keyframe = removed.successor;
  }
  return frame;
}

Rigid3 Submap::CamFromSubmap(const TrackedFrame& frame) const {
  const TrackedFrame resolved = Resolved(frame);
  return resolved.cam_from_keyframe * keyframes.at(resolved.keyframe).cam_from_submap;
}

CompactVector<SharingKeyframe> Submap::CountShared(const SubmapKeyframe& keyframe) const {
  if (!has_observations) return keyframe.shared;
  std::map<KeyframeId, int> counts;
  for (const MapPointId point_id : keyframe.map_points) {
    const auto point = point_id.IsValid() ? points.find(point_id) : points.end();
    if (point == points.end()) continue;
    for (const SubmapObservation& o : point->second.observations) ++counts[o.keyframe];
  }
  counts.erase(keyframe.id);
  CompactVector<SharingKeyframe> shared(counts.size());
  std::transform(counts.begin(), counts.end(), shared.begin(), [](const auto& c) {
    return SharingKeyframe{c.first, c.second};
  });
  return shared;
}

void Submap::ForgetWide(const WideFeaturesRecord& record) {
  (record.keyframe.IsValid() ? wide.at(record.keyframe) : wide_between.at(record.frame)).features = nullptr;
}

void Submap::ForgetObservations() {
  for (auto& [keyframe_id, keyframe] : keyframes) keyframe.shared = CountShared(keyframe);
  for (auto& [point_id, point] : points) point.observations = {};
  has_observations = false;
}

std::string Session::Apply(const Record& record) {
  if (record.header.seq <= last_seq) {
    return "seq " + std::to_string(record.header.seq) + " after " + std::to_string(last_seq);
  }
  if (ended) return "record after the end of the session";
  std::string error;
  if (const auto* body = std::get_if<SessionStarted>(&record.body)) {
    if (record.header.seq != 0) return "session started twice";
    id = record.header.session;
    start_utime = record.header.utime;
    info = *body;
  } else if (record.header.seq == 0) {
    return "the first record of a session must be its start";
  } else if (const auto* end = std::get_if<SessionEnded>(&record.body)) {
    ended = true;
    num_frames = end->num_frames;
  } else if (const auto* start = std::get_if<SubmapStarted>(&record.body)) {
    if (!start->submap.IsValid() || submaps.contains(start->submap)) return "submap started twice";
    submaps[start->submap].id = start->submap;
  } else if (const auto* told = std::get_if<PositionsRecord>(&record.body)) {
    for (const PositionFix& fix : told->fixes) {
      if (std::string problem = ProblemOf(fix); !problem.empty()) return "positions: " + problem;
    }
    positions.insert(positions.end(), told->fixes.begin(), told->fixes.end());
  } else {
    const SubmapId submap_id = std::visit(
        [](const auto& b) {
          if constexpr (requires { b.submap; })
            return b.submap;
          else
            return SubmapId();
        },
        record.body);
    const auto it = submaps.find(submap_id);
    if (it == submaps.end()) return "unknown submap " + std::to_string(submap_id.value);
    Submap& submap = it->second;
    if (const auto* wide = std::get_if<WideFeaturesRecord>(&record.body)) {
      error = ApplyWide(&submap, record.header, *wide);
      if (error.empty()) last_seq = record.header.seq;
      return error;
    }
    if (submap.ended) return "submap " + std::to_string(submap_id.value) + " has ended";
    if (const auto* submap_end = std::get_if<SubmapEnded>(&record.body)) {
      submap.ended = true;
      submap.end_reason = submap_end->reason;
      submap.end_detail = submap_end->detail;
      submap.last_frame = submap_end->last_frame;
      submap.points.shrink_to_fit();  // as it will stay
    } else if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body)) {
      error = ApplyKeyframe(&submap, record.header, *keyframe);
    } else if (const auto* update = std::get_if<MapUpdate>(&record.body)) {
      error = CheckUpdate(submap, *update);
      if (error.empty()) ApplyUpdate(&submap, *update);
    }
  }
  if (!error.empty()) return error;
  last_seq = record.header.seq;
  return "";
}

int CountSharedPoints(const SubmapKeyframe& a, const SubmapKeyframe& b) {
  std::unordered_set<MapPointId> points;
  for (const MapPointId id : a.map_points) {
    if (id.IsValid()) points.insert(id);
  }
  return static_cast<int>(std::count_if(b.map_points.begin(), b.map_points.end(),
                                        [&](MapPointId id) { return id.IsValid() && points.contains(id); }));
}

}  // namespace mapmend
