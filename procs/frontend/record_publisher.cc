#include "procs/frontend/record_publisher.h"

#include <algorithm>

#include "libs/retrieval/vocabulary.h"
#include "procs/frontend/profiler.h"

namespace mapmend {
namespace {

bool IsEmpty(const MapUpdate& update) {
  return update.keyframes.empty() && update.points.empty() && update.observations.empty() &&
         update.removed_keyframes.empty() && update.removed_points.empty() && update.frames.empty();
}

}  // namespace

void RecordPublisher::Begin() {
  believed_ = false;
  next_keyframe_ = KeyframeIndex(0);
  frames_.clear();
}

void RecordPublisher::Forget() {
  num_tracked_ -= static_cast<int>(frames_.size());
  frames_.clear();
}

void RecordPublisher::NoteFrame(const WorkingMap& map, const Frame& frame, const Rigid3& cam_from_submap,
                                KeyframeIndex reference_keyframe) {
  const WorkingKeyframe& reference = map.Keyframe(reference_keyframe);
  frames_.push_back({frame.index, frame.utime, reference.id, cam_from_submap * reference.cam_from_submap.Inverse()});
  ++num_tracked_;
}

void RecordPublisher::NoteKeyframe(const WorkingMap& map, KeyframeIndex keyframe) {
  const WorkingKeyframe& source = map.Keyframe(keyframe);
  NoteFrame(map, *source.frame, source.cam_from_submap, keyframe);
}

const TrackedFrame& RecordPublisher::FirstFrame() const {
  const auto by_frame = [](const TrackedFrame& a, const TrackedFrame& b) { return a.frame < b.frame; };
  return *std::min_element(frames_.begin(), frames_.end(), by_frame);
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
    if (take_image_) take_image_(source.id, *source.frame);
    source.frame->original = {};
    map->MarkPublished(next_keyframe_);
    records.emplace_back(map->Keyframe(next_keyframe_).frame->utime, std::move(record));
  }
  MapUpdate update = map->TakeUpdate();
  // Frames that refer to a keyframe that is not in the map yet follow with it.
  const KeyframeId last_published = map->Keyframe(KeyframeIndex(next_keyframe_ - 1)).id;
  const auto later = std::stable_partition(frames_.begin(), frames_.end(),
                                           [&](const TrackedFrame& f) { return !(last_published < f.keyframe); });
  update.frames.assign(frames_.begin(), later);
  frames_.erase(frames_.begin(), later);
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

void RecordPublisher::EmitAll(Records records) const {
  const StageTimer timer("map/publish");
  for (auto& [utime, body] : records) {
    if (auto* keyframe = std::get_if<KeyframeRecord>(&body)) AddWords(keyframe);
    emit_(utime, std::move(body));
  }
}

void RecordPublisher::PublishWaitingFrames(int64_t utime, SubmapId submap, bool is_live) {
  if (!believed_ || next_keyframe_ == 0 || frames_.empty()) return;
  const bool has_many = static_cast<int>(frames_.size()) >= options_.max_waiting_frames;
  const bool has_old = is_live && static_cast<double>(utime - frames_.front().utime) >= 1e6 * options_.max_waiting_s;
  if (!has_many && !has_old) return;
  MapUpdate update;
  update.submap = submap;
  update.frames = std::exchange(frames_, {});
  emit_(utime, std::move(update));
}

void RecordPublisher::End(const Frame& last, LossReason reason, const std::string& detail,
                          const WorkingMap& map) const {
  emit_(last.utime, SubmapEnded{map.Id(), ToString(reason), detail, last.index, last.utime});
}

}  // namespace mapmend
