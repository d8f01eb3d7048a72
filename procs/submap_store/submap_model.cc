#include "procs/submap_store/submap_model.h"

#include <algorithm>

namespace mapmend {

std::string ApplyLight(const Record& record, Session* session) {
  std::string error = session->Apply(record);
  if (const auto* wide = std::get_if<WideFeaturesRecord>(&record.body); wide != nullptr && error.empty())
    session->submaps.at(wide->submap).ForgetWide(*wide);
  const auto* body = std::get_if<KeyframeRecord>(&record.body);
  if (!error.empty() || body == nullptr) return error;
  SubmapKeyframe& keyframe = session->submaps.at(body->submap).keyframes.at(body->keyframe);
  keyframe.features.descriptors = {};
  keyframe.features.colors = {};
  keyframe.words = {};
  keyframe.nodes = {};
  keyframe.bow = {};
  return error;
}

std::map<KeyframeId, int> SharedPoints(const Submap& submap, KeyframeId id) {
  std::map<KeyframeId, int> shared;
  const auto it = submap.keyframes.find(id);
  if (it == submap.keyframes.end()) return shared;
  // Thousands of observations, few keyframes: counted by a keyframe's place in the submap (ids may lie far apart).
  std::vector<KeyframeId> ids;
  for (const auto& [other, keyframe] : submap.keyframes) ids.push_back(other);
  std::vector<int> counts(ids.size(), 0);
  for (const MapPointId point : it->second.map_points) {
    const auto found = point.IsValid() ? submap.points.find(point) : submap.points.end();
    if (found == submap.points.end()) continue;
    KeyframeId previous;  // observations ascend by keyframe; two features may observe the same point
    auto at = ids.begin();
    for (const SubmapObservation& observation : found->second.observations) {
      if (observation.keyframe != id && observation.keyframe != previous) {
        at = std::lower_bound(at, ids.end(), observation.keyframe);
        ++counts[static_cast<size_t>(at - ids.begin())];
      }
      previous = observation.keyframe;
    }
  }
  for (size_t i = 0; i < ids.size(); ++i) {
    if (counts[i] > 0) shared.emplace_hint(shared.end(), ids[i], counts[i]);
  }
  return shared;
}

std::vector<KeyframeId> CovisibleKeyframes(const Submap& submap, KeyframeId id) {
  std::vector<std::pair<int, KeyframeId>> order;
  for (const auto& [other, count] : SharedPoints(submap, id)) {
    if (count >= kMinCovisible) order.emplace_back(-count, other);
  }
  std::sort(order.begin(), order.end());
  if (order.size() > kMaxCovisible) order.resize(kMaxCovisible);
  std::vector<KeyframeId> keyframes;
  for (const auto& [count, other] : order) keyframes.push_back(other);
  return keyframes;
}

int CountMapPoints(const SubmapKeyframe& keyframe) {
  return static_cast<int>(std::count_if(keyframe.map_points.begin(), keyframe.map_points.end(),
                                        [](MapPointId id) { return id.IsValid(); }));
}

SubmapId SubmapOf(const RecordBody& body) {
  return std::visit(
      [](const auto& b) {
        if constexpr (requires { b.submap; }) {
          return b.submap;
        } else {
          return SubmapId();
        }
      },
      body);
}

}  // namespace mapmend
