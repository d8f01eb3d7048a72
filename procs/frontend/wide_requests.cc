#include "procs/frontend/wide_requests.h"

#include <algorithm>

namespace mapmend {
namespace {

// Those that are in the map, by time.
std::vector<const WorkingKeyframe*> KeyframesByTime(const WorkingMap& map) {
  std::vector<const WorkingKeyframe*> keyframes;
  for (const WorkingKeyframe& k : map.Keyframes()) {
    if (!k.removed) keyframes.push_back(&k);
  }
  const auto is_earlier = [](const WorkingKeyframe* l, const WorkingKeyframe* r) {
    return l->frame->utime < r->frame->utime;
  };
  std::stable_sort(keyframes.begin(), keyframes.end(), is_earlier);
  return keyframes;
}

bool IsIn(const FramePtr& frame, const std::deque<FramePtr>& frames) {
  return std::find(frames.begin(), frames.end(), frame) != frames.end();
}

}  // namespace

void WideRequests::OnFrame(const FramePtr& frame, const WorkingMap* map) {
  if (!extraction_) return;
  ++num_frames_;
  newest_.push_back(frame);
  LetGo(static_cast<size_t>(options_.num_keyframes), map);
}

void WideRequests::OnKeyframe(const FramePtr& frame) {
  if (extraction_) held_.push_back(HolderOf(frame));
}

void WideRequests::AfterFrame(const FramePtr& frame, bool is_tracked) {
  if (!extraction_) return;
  if (is_tracked) {
    gap_.clear();
    gap_is_whole_ = true;
  } else if (gap_.size() < static_cast<size_t>(options_.max_images)) {
    gap_.push_back(frame);
  } else {
    gap_is_whole_ = false;  // too many to lead from photo to photo
    gap_.clear();
  }
}

// Photos between two submaps may lead from the one to the other where both look too different.
void WideRequests::OnBelieved(int64_t begin) {
  if (!extraction_ || !gap_is_whole_ || !closed_.IsValid()) return;
  std::erase_if(gap_, [&](const FramePtr& f) { return f->utime >= begin || !f->image; });
  const size_t n = std::min(gap_.size(), static_cast<size_t>(options_.num_keyframes));
  for (size_t i = 0; i < n; ++i) {
    const Frame& frame = *gap_[n == 1 ? 0 : i * (gap_.size() - 1) / (n - 1)];
    extraction_->Request(closed_, KeyframeId(), frame, num_frames_ + options_.delay_frames);
  }
  gap_.clear();
}

void WideRequests::OnTracked(const WorkingMap& map) {
  if (!extraction_ || first_requested_ || map.Id().value == 0) return;
  if (map.LastKeyframe() + 1 >= options_.num_keyframes) RequestKeyframes(map, false);
}

void WideRequests::OnEnd(const WorkingMap& map, bool is_lost) {
  if (!extraction_) return;
  if (map.Id().value > 0) RequestKeyframes(map, false);
  if (is_lost || map.Id().value > 0) RequestKeyframes(map, true);
  closed_ = map.Id();
}

void WideRequests::OnLeft() {
  if (!extraction_) return;
  LetGo(0, nullptr);
  first_requested_ = false;
  requested_.clear();
}

// Of the first or the last keyframes, those that have an image and were not asked for yet.
void WideRequests::RequestKeyframes(const WorkingMap& map, bool last) {
  if (!last) first_requested_ = true;
  const std::vector<const WorkingKeyframe*> keyframes = KeyframesByTime(map);
  const size_t n = std::min(keyframes.size(), static_cast<size_t>(options_.num_keyframes));
  const size_t begin = last ? keyframes.size() - n : 0;
  for (size_t i = begin; i < begin + n; ++i) {
    const WorkingKeyframe& keyframe = *keyframes[i];
    const Frame& holder = *HolderOf(keyframe.frame);
    if (!holder.image || !requested_.insert(keyframe.id).second) continue;
    extraction_->Request(map.Id(), keyframe.id, holder, num_frames_ + options_.delay_frames);
  }
}

void WideRequests::LetGo(size_t num_held, const WorkingMap* map) {
  while (newest_.size() > static_cast<size_t>(options_.max_images)) {
    if (!IsIn(newest_.front(), held_)) LetGoOfImage(*newest_.front());
    newest_.pop_front();
  }
  // Those that were first are still wanted until they are asked for.
  if (map != nullptr && !first_requested_ && map->Id().value > 0) return;
  for (; held_.size() > num_held; held_.pop_front()) {
    if (!IsIn(held_.front(), newest_)) LetGoOfImage(*held_.front());
  }
}

RecordPublisher::Records WideRequests::Take(int64_t due) {
  return extraction_ ? extraction_->TakeDue(due) : RecordPublisher::Records();
}

RecordPublisher::Records WideRequests::TakeReady() {
  return extraction_ ? extraction_->TakeFinished() : RecordPublisher::Records();
}

}  // namespace mapmend
