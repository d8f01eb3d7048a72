#include "libs/connecting/local_window.h"

#include <algorithm>

namespace mapmend {

std::vector<CovisibleKeyframe> FindCovisible(const Submap& submap, const SubmapKeyframe& keyframe, int min_shared) {
  std::vector<CovisibleKeyframe> result;
  for (const SharingKeyframe& s : submap.CountShared(keyframe)) {
    if (s.num_points >= min_shared) result.push_back({&submap.keyframes.at(s.keyframe), s.num_points});
  }
  std::stable_sort(result.begin(), result.end(),
                   [](const CovisibleKeyframe& l, const CovisibleKeyframe& r) { return l.num_shared > r.num_shared; });
  return result;
}

std::vector<const SubmapKeyframe*> LocalWindow(const Submap& submap, KeyframeId keyframe, int size, int min_shared) {
  const SubmapKeyframe& self = submap.keyframes.at(keyframe);
  std::vector<const SubmapKeyframe*> window = {&self};
  for (const CovisibleKeyframe& c : FindCovisible(submap, self, min_shared)) {
    if (static_cast<int>(window.size()) >= size) break;
    window.push_back(c.keyframe);
  }
  return window;
}

double MedianDepth(const Submap& submap, const SubmapKeyframe& keyframe) {
  std::vector<double> depths;
  for (const MapPointId id : keyframe.map_points) {
    const auto point = id.IsValid() ? submap.points.find(id) : submap.points.end();
    if (point != submap.points.end())
      depths.push_back((keyframe.cam_from_submap * point->second.position.cast<double>()).z());
  }
  if (depths.empty()) return 0;
  const auto middle = depths.begin() + static_cast<long>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

}  // namespace mapmend
