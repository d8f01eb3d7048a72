#include "libs/connecting/neighbors_in_time.h"

#include <algorithm>
#include <iterator>

namespace mapmend {
namespace {

// Frames that were tracked backwards become keyframes late: ids are not in the order of time.
std::vector<std::pair<int64_t, KeyframeId>> ByTime(const Submap& submap) {
  std::vector<std::pair<int64_t, KeyframeId>> keyframes;
  for (const auto& [id, keyframe] : submap.keyframes) keyframes.push_back({keyframe.utime, id});
  std::sort(keyframes.begin(), keyframes.end());
  return keyframes;
}

}  // namespace

std::vector<std::pair<SubmapId, std::vector<KeyframeId>>> NeighborsInTime(const Session& session, SubmapId submap,
                                                                          KeyframeId keyframe,
                                                                          const NeighborsInTimeOptions& options) {
  std::vector<std::pair<SubmapId, std::vector<KeyframeId>>> neighbors;
  const auto own = session.submaps.find(submap);
  const std::pair<int64_t, KeyframeId> self{own->second.keyframes.at(keyframe).utime, keyframe};
  const auto earlier = std::count_if(own->second.keyframes.begin(), own->second.keyframes.end(),
                                     [&](const auto& k) { return std::pair(k.second.utime, k.first) < self; });
  if (earlier >= options.num_keyframes) return neighbors;
  for (auto it = std::make_reverse_iterator(own);
       it != session.submaps.rend() && static_cast<int>(neighbors.size()) < options.num_submaps; ++it) {
    if (!it->second.ended) continue;
    const std::vector<std::pair<int64_t, KeyframeId>> keyframes = ByTime(it->second);
    std::vector<KeyframeId> last;
    for (auto k = keyframes.rbegin(); k != keyframes.rend() && static_cast<int>(last.size()) < options.num_keyframes;
         ++k) {
      last.push_back(k->second);
    }
    neighbors.push_back({it->first, std::move(last)});
  }
  return neighbors;
}

}  // namespace mapmend
