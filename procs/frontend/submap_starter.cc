#include "procs/frontend/submap_starter.h"

#include <algorithm>
#include <utility>

namespace mapmend {
namespace {

constexpr KeyframeIndex kStart(0), kSecond(1);  // of a submap that has just begun

}  // namespace

std::unique_ptr<WorkingMap> MapOfBeginning(const Initialization& initialization, SubmapId id, const Pyramid& pyramid,
                                           LocalMapper* mapper, IdSource* ids) {
  auto map = std::make_unique<WorkingMap>(id, pyramid, ids);
  map->AddKeyframe(initialization.first, Rigid3());
  map->AddKeyframe(initialization.second, initialization.second_from_first);
  for (const InitialPoint& p : initialization.points) {
    const PointIndex point = map->AddPoint(p.position, kStart);
    map->AddObservation(point, kStart, p.first_feature);
    map->AddObservation(point, kSecond, p.second_feature);
    map->RefreshPoint(point);
  }
  mapper->AdjustAll(map.get());
  return map;
}

std::unique_ptr<WorkingMap> SubmapStarter::Start(const Initialization& initialization,
                                                 const std::deque<FramePtr>& frames, IdSource* ids) {
  const IdSource ids_before = *ids;
  std::unique_ptr<WorkingMap> map = MapOfBeginning(initialization, SubmapId(ids->next_submap), pyramid_, mapper_, ids);
  if (map->NumPoints() < options_.initializer.min_points) {
    *ids = ids_before;
    return nullptr;
  }
  ++ids->next_submap;
  publisher_->Begin();
  publisher_->NoteKeyframe(*map, kStart);
  publisher_->NoteKeyframe(*map, kSecond);
  TrackBetween(initialization, frames, map.get());
  TrackBefore(initialization, frames, map.get());
  return map;
}

void SubmapStarter::TrackBetween(const Initialization& initialization, const std::deque<FramePtr>& frames,
                                 WorkingMap* map) {
  auto at = std::find(frames.begin(), frames.end(), initialization.first);
  for (at = at == frames.end() ? at : at + 1; at != frames.end() && *at != initialization.second; ++at) {
    const TrackResult result = tracker_->TrackAfterwards({kStart, kSecond}, **at, map);
    if (result.success) publisher_->NoteFrame(*map, **at, result);
  }
}

// Backwards: the frame next to those with a pose saw most of their ground.
void SubmapStarter::TrackBefore(const Initialization& initialization, const std::deque<FramePtr>& frames,
                                WorkingMap* map) {
  auto at = std::make_reverse_iterator(std::find(frames.begin(), frames.end(), initialization.first));
  KeyframeIndex hint = kStart;
  int misses = 0;
  for (; at != frames.rend() && misses < options_.max_misses; ++at) {
    const FramePtr& frame = *at;
    if (frame == initialization.second) continue;
    const TrackResult result = tracker_->TrackAfterwards({hint}, *frame, map);
    misses = result.success ? 0 : misses + 1;
    if (!result.success) continue;
    if (policy_->NeedsKeyframe(policy_->Measure(*map, result))) {
      hint = map->AddKeyframe(frame, result.cam_from_submap, result.points);
      mapper_->Process(hint, map);
      publisher_->NoteKeyframe(*map, hint);
    } else {
      publisher_->NoteFrame(*map, *frame, result);
    }
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
