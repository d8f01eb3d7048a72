#include "procs/frontend/submap_starter.h"

#include <algorithm>
#include <utility>

namespace mapmend {

std::unique_ptr<WorkingMap> SubmapStarter::Start(const Initialization& initialization, IdSource* ids) {
  const IdSource ids_before = *ids;
  auto map = std::make_unique<WorkingMap>(SubmapId(ids->next_submap), pyramid_, ids);
  const InitialKeyframes initial = AddInitialKeyframes(initialization, map.get());
  mapper_->AdjustAll(map.get());
  if (map->NumPoints() < options_.initializer.min_points) {
    *ids = ids_before;
    return nullptr;
  }
  ++ids->next_submap;
  publisher_->Begin();
  for (int k = initial.first; k <= initial.second; ++k) publisher_->NoteFrame(*map, *map->Keyframe(k).frame, k);
  TrackBetween(initialization, initial, map.get());
  TrackBefore(initialization, initial, map.get());
  return map;
}

void SubmapStarter::TrackBetween(const Initialization& initialization, const InitialKeyframes& initial,
                                 WorkingMap* map) {
  const std::deque<FramePtr>& frames = initializer_.Frames();
  auto at = std::find(frames.begin(), frames.end(), initialization.first);
  for (at = at == frames.end() ? at : at + 1; at != frames.end(); ++at) {
    if (IsInitialView(initialization, **at)) continue;
    const TrackResult result = tracker_->TrackAfterwards({initial.first, initial.second}, map, at->get());
    if (result.success) publisher_->NoteFrame(*map, **at, result.reference_keyframe);
  }
}

// Backwards: the frame next to those with a pose saw most of their ground.
void SubmapStarter::TrackBefore(const Initialization& initialization, const InitialKeyframes& initial,
                                WorkingMap* map) {
  const std::deque<FramePtr>& frames = initializer_.Frames();
  auto at = std::make_reverse_iterator(std::find(frames.begin(), frames.end(), initialization.first));
  int hint = initial.first, misses = 0;
  for (; at != frames.rend() && misses < options_.max_misses; ++at) {
    const FramePtr& frame = *at;
    if (IsInitialView(initialization, *frame)) continue;
    const TrackResult result = tracker_->TrackAfterwards({hint}, map, frame.get());
    misses = result.success ? 0 : misses + 1;
    if (!result.success) continue;
    int reference = result.reference_keyframe;
    if (policy_->NeedsKeyframe(policy_->Measure(*map, *frame, reference, result.num_inliers))) {
      reference = hint = map->AddKeyframe(frame);
      mapper_->Process(hint, map);
    }
    publisher_->NoteFrame(*map, *frame, reference);
  }
}

void SubmapStarter::NoteMistake(const FramePtr& first) {
  const std::deque<FramePtr>& frames = initializer_.Frames();
  const auto at = std::find(frames.begin(), frames.end(), first);
  if (at == frames.end() || at + 1 == frames.end()) return;
  const FramePtr next = *(at + 1);
  initializer_.DropBefore(next);
}

}  // namespace mapmend
