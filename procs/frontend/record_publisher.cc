#include "procs/frontend/record_publisher.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <map>
#include <utility>

#include "libs/geometry/interpolation.h"
#include "libs/retrieval/vocabulary.h"
#include "procs/frontend/profiler.h"

namespace mapmend {
namespace {

bool IsEmpty(const MapUpdate& update) {
  return update.keyframes.empty() && update.points.empty() && update.observations.empty() &&
         update.removed_keyframes.empty() && update.removed_points.empty() && update.frames.empty();
}

// The keyframe that is there and nearest in time.
KeyframeIndex NearestInTime(const WorkingMap& map, int64_t utime) {
  KeyframeIndex nearest;
  const auto away = [&](KeyframeIndex k) { return std::abs(map.Keyframe(k).frame->utime - utime); };
  for (KeyframeIndex k(0); k <= map.LastKeyframe(); ++k) {
    if (!map.Keyframe(k).removed && (nearest.IsNone() || away(k) < away(nearest))) nearest = k;
  }
  return nearest;
}

// The pose at this time, or between those before and after it.
Rigid3 PoseAt(const std::map<int64_t, Rigid3>& known, int64_t utime) {
  const auto after = known.lower_bound(utime);
  if (after == known.end()) return std::prev(after)->second;
  if (after->first == utime || after == known.begin()) return after->second;
  const auto before = std::prev(after);
  const double share = static_cast<double>(utime - before->first) / static_cast<double>(after->first - before->first);
  return Between(before->second, after->second, share);
}

}  // namespace

void RecordPublisher::Begin() {
  believed_ = false;
  next_keyframe_ = KeyframeIndex(0);
  frames_.clear();
  young_.clear();
}

void RecordPublisher::Forget() {
  num_tracked_ -= static_cast<int>(frames_.size());
  frames_.clear();
}

void RecordPublisher::Note(const WorkingMap& map, const Frame& frame, const Rigid3& cam_from_submap,
                           KeyframeIndex reference, const std::vector<PointIndex>& points, bool is_keyframe) {
  const WorkingKeyframe& keyframe = map.Keyframe(reference);
  frames_.push_back({{frame.index, frame.utime, keyframe.id, cam_from_submap * keyframe.cam_from_submap.Inverse()},
                     reference,
                     SightingsOf(frame, points, pyramid_),
                     is_keyframe});
  ++num_tracked_;
}

void RecordPublisher::NoteFrame(const WorkingMap& map, const Frame& frame, const TrackResult& tracked) {
  Note(map, frame, tracked.cam_from_submap, tracked.reference_keyframe, tracked.points, false);
}

void RecordPublisher::NoteKeyframe(const WorkingMap& map, KeyframeIndex keyframe) {
  const WorkingKeyframe& source = map.Keyframe(keyframe);
  Note(map, *source.frame, source.cam_from_submap, keyframe, source.points, true);
}

TrackedFrame RecordPublisher::FirstFrame() const {
  const auto by_frame = [](const WaitingFrame& a, const WaitingFrame& b) { return a.frame.frame < b.frame.frame; };
  return std::min_element(frames_.begin(), frames_.end(), by_frame)->frame;
}

std::vector<TrackedFrame> RecordPublisher::TakeFrames(KeyframeId last_published, const WorkingMap& map) {
  const StageTimer timer("map/frames");
  const auto later = std::stable_partition(frames_.begin(), frames_.end(), [&](const WaitingFrame& waiting) {
    return !(last_published < waiting.frame.keyframe);
  });
  std::vector<TrackedFrame> taken;
  for (auto it = frames_.begin(); it != later; ++it) {
    const Rigid3& reference = map.Keyframe(it->reference).cam_from_submap;
    if (!it->is_keyframe) {
      if (const auto refined = refinement_.Refine(it->frame.cam_from_keyframe * reference, it->sightings, map))
        it->frame.cam_from_keyframe = *refined * reference.Inverse();
    }
    taken.push_back(it->frame);
  }
  KeepYoung({std::make_move_iterator(frames_.begin()), std::make_move_iterator(later)}, map);
  frames_.erase(frames_.begin(), later);
  return taken;
}

void RecordPublisher::KeepYoung(std::vector<WaitingFrame> frames, const WorkingMap& map) {
  if (map.LastKeyframe() >= options_.max_keyframes_of_young) {
    young_.clear();
    return;
  }
  std::move(frames.begin(), frames.end(), std::back_inserter(young_));
  if (const size_t most = options_.max_frames_of_young; young_.size() > most)
    young_.erase(young_.begin(), young_.end() - static_cast<long>(most));
}

void RecordPublisher::OnReplaced(const WorkingMap& map, const std::vector<PointIndex>& new_of_old) {
  std::map<int64_t, Rigid3> known;  // poses by time
  for (const WorkingKeyframe& keyframe : map.Keyframes()) {
    if (!keyframe.removed) known[keyframe.frame->utime] = keyframe.cam_from_submap;
  }
  std::vector<WaitingFrame> frames = std::exchange(young_, {});
  for (WaitingFrame& waiting : std::exchange(frames_, {})) frames.push_back(std::move(waiting));
  for (WaitingFrame& waiting : frames) {
    std::erase_if(waiting.sightings, [&](Sighting& s) {
      s.point = new_of_old[s.point];
      return s.point.IsNone();
    });
    if (known.contains(waiting.frame.utime)) continue;
    if (const auto pose = refinement_.FindAnew(waiting.sightings, map)) known[waiting.frame.utime] = *pose;
  }
  for (WaitingFrame& waiting : frames) {
    waiting.reference = NearestInTime(map, waiting.frame.utime);
    waiting.is_keyframe = map.Keyframe(waiting.reference).frame->utime == waiting.frame.utime;
    const WorkingKeyframe& keyframe = map.Keyframe(waiting.reference);
    waiting.frame.keyframe = keyframe.id;
    waiting.frame.cam_from_keyframe = PoseAt(known, waiting.frame.utime) * keyframe.cam_from_submap.Inverse();
    frames_.push_back(std::move(waiting));
  }
}

KeyframeRecord RecordPublisher::Describe(KeyframeIndex keyframe, const WorkingMap& map) const {
  const WorkingKeyframe& source = map.Keyframe(keyframe);
  KeyframeRecord record;
  record.submap = map.Id();
  record.keyframe = source.id;
  record.frame = source.frame->index;
  record.cam_from_submap = source.cam_from_submap;
  record.features = source.frame->features;
  record.map_points = map.PublishedPoints(keyframe);
  return record;
}

RecordPublisher::Records RecordPublisher::Take(int64_t utime, KeyframeIndex last_keyframe, WorkingMap* map) {
  Records records;
  if (!believed_) return records;
  if (next_keyframe_ == 0) records.emplace_back(map->Keyframes().front().frame->utime, SubmapStarted{map->Id()});
  for (; next_keyframe_ <= last_keyframe; ++next_keyframe_) {
    KeyframeRecord record = Describe(next_keyframe_, *map);
    const WorkingKeyframe& source = map->Keyframe(next_keyframe_);
    const Frame& holder = *HolderOf(source.frame);
    if (take_image_) take_image_(source.id, holder);
    holder.original.LetGo();
    map->MarkPublished(next_keyframe_);
    records.emplace_back(map->Keyframe(next_keyframe_).frame->utime, std::move(record));
  }
  MapUpdate update = map->TakeUpdate();
  // Frames that refer to a keyframe that is not in the map yet follow with it.
  update.frames = TakeFrames(map->Keyframe(KeyframeIndex(next_keyframe_ - 1)).id, *map);
  if (!IsEmpty(update)) records.emplace_back(utime, std::move(update));
  return records;
}

void RecordPublisher::AddWords(KeyframeRecord* record) const {
  if (vocabulary_ == nullptr) {
    record->words.assign(record->features.Size(), -1);
    record->nodes.assign(record->features.Size(), -1);
    return;
  }
  BowTransform transform = vocabulary_->Transform(record->features);
  record->words = std::move(transform.words);
  record->nodes = std::move(transform.nodes);
  record->bow = std::move(transform.bow);
}

void RecordPublisher::EmitAll(Records&& records) const {
  const StageTimer timer("map/publish");
  for (auto& [utime, body] : records) {
    if (auto* keyframe = std::get_if<KeyframeRecord>(&body)) AddWords(keyframe);
    emit_(utime, std::move(body));
  }
}

void RecordPublisher::PublishWaitingFrames(int64_t utime, const WorkingMap& map, bool is_live) {
  if (!believed_ || next_keyframe_ == 0 || frames_.empty()) return;
  const bool has_many = static_cast<int>(frames_.size()) >= options_.max_waiting_frames;
  const bool has_old =
      is_live && static_cast<double>(utime - frames_.front().frame.utime) >= 1e6 * options_.max_waiting_s;
  if (!has_many && !has_old) return;
  MapUpdate update;
  update.submap = map.Id();
  for (const WaitingFrame& waiting : frames_) update.frames.push_back(waiting.frame);
  KeepYoung(std::exchange(frames_, {}), map);
  emit_(utime, std::move(update));
}

void RecordPublisher::End(const Frame& last, LossReason reason, const std::string& detail,
                          const WorkingMap& map) const {
  emit_(last.utime, SubmapEnded{map.Id(), ToString(reason), detail, last.index, last.utime});
}

}  // namespace mapmend
