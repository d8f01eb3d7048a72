#include "procs/frontend/initial_keyframes.h"

#include <algorithm>

namespace mapmend {
namespace {

int AddView(const FramePtr& frame, const Rigid3& cam_from_submap, WorkingMap* map) {
  frame->points.assign(frame->features.Size(), -1);
  frame->cam_from_submap = cam_from_submap;
  return map->AddKeyframe(frame);
}

}  // namespace

InitialKeyframes AddInitialKeyframes(const Initialization& initialization, WorkingMap* map) {
  InitialKeyframes keyframes;
  keyframes.first = AddView(initialization.first, Rigid3(), map);
  std::vector<int> between;
  for (const InitialView& view : initialization.between) between.push_back(AddView(view.frame, view.from_first, map));
  keyframes.second = AddView(initialization.second, initialization.second_from_first, map);
  for (size_t i = 0; i < initialization.points.size(); ++i) {
    const InitialPoint& p = initialization.points[i];
    const int point = map->AddPoint(p.position, keyframes.first);
    map->AddObservation(point, keyframes.first, p.first_feature);
    for (size_t v = 0; v < between.size(); ++v) {
      const int feature = initialization.between[v].features[i];
      if (feature >= 0) map->AddObservation(point, between[v], feature);
    }
    map->AddObservation(point, keyframes.second, p.second_feature);
    map->RefreshPoint(point);
  }
  return keyframes;
}

bool IsInitialView(const Initialization& initialization, const Frame& frame) {
  const auto is_frame = [&](const InitialView& view) { return view.frame.get() == &frame; };
  return initialization.first.get() == &frame || initialization.second.get() == &frame ||
         std::any_of(initialization.between.begin(), initialization.between.end(), is_frame);
}

}  // namespace mapmend
