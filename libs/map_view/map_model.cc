#include "libs/map_view/map_model.h"

#include <algorithm>
#include <utility>

namespace mapmend {
namespace {

bool IsPair(const EvaluatedConnection& c, const SubmapKey& a, const SubmapKey& b) {
  return (c.a == a && c.b == b) || (c.a == b && c.b == a);
}

}  // namespace

std::string MapModel::Apply(const Record& record) {
  const std::string& id = record.header.session;
  const bool known = sessions_.contains(id);
  const std::string problem = sessions_[id].Apply(record);
  if (!problem.empty()) {
    if (!known) sessions_.erase(id);
    return problem;
  }
  ++version_;
  if (!known) session_order_.push_back(id);
  last_utimes_[id] = record.header.utime;
  if (const auto* wide = std::get_if<WideFeaturesRecord>(&record.body))
    sessions_[id].submaps.at(wide->submap).ForgetWide(*wide);
  if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body)) {
    keyframe_utimes_[id][keyframe->keyframe] = record.header.utime;
    SubmapKeyframe& kept = sessions_[id].submaps.at(keyframe->submap).keyframes.at(keyframe->keyframe);
    std::vector<Descriptor>().swap(kept.features.descriptors);
    std::vector<int32_t>().swap(kept.words);
    std::vector<int32_t>().swap(kept.nodes);
    kept.bow = BowVector();
  }
  return "";
}

bool MapModel::SetRevision(MapRevision map) {
  if (map.transforms.revision < revision_.transforms.revision) return false;
  if (map.connections.empty()) map.connections = std::move(revision_.connections);
  revision_ = std::move(map);
  ++version_;
  return true;
}

bool MapModel::SetTransforms(MergedTransforms transforms) {
  if (transforms.revision <= revision_.transforms.revision) return false;
  for (EvaluatedConnection& c : revision_.connections) {
    c.in_tree = std::any_of(transforms.edges.begin(), transforms.edges.end(), [&](const auto& edge) {
      return IsPair(c, transforms.submaps[edge.first].key, transforms.submaps[edge.second].key);
    });
  }
  revision_.transforms = std::move(transforms);
  revision_.refined.clear();
  ++version_;
  return true;
}

void MapModel::SetConnection(const EvaluatedConnection& connection) {
  ++version_;
  const auto it =
      std::find_if(revision_.connections.begin(), revision_.connections.end(),
                   [&](const EvaluatedConnection& other) { return IsPair(other, connection.a, connection.b); });
  if (it == revision_.connections.end()) {
    revision_.connections.push_back(connection);
  } else {
    *it = connection;
  }
}

int64_t MapModel::KeyframeUtime(const std::string& session, KeyframeId keyframe) const {
  return keyframe_utimes_.at(session).at(keyframe);
}

std::optional<int64_t> MapModel::FindKeyframeUtime(const std::string& session, KeyframeId keyframe) const {
  const auto of_session = keyframe_utimes_.find(session);
  if (of_session == keyframe_utimes_.end()) return std::nullopt;
  const auto it = of_session->second.find(keyframe);
  return it == of_session->second.end() ? std::nullopt : std::optional(it->second);
}

bool MapModel::AllEnded() const {
  return !sessions_.empty() &&
         std::all_of(sessions_.begin(), sessions_.end(), [](const auto& entry) { return entry.second.ended; });
}

bool MapModel::IsComplete() const {
  const MergedTransforms& merged = revision_.transforms;
  if (!merged.is_final || !AllEnded()) return false;
  return std::all_of(sessions_.begin(), sessions_.end(), [&](const auto& entry) {
    const StreamCursor all{entry.first, entry.second.last_seq};
    return std::find(merged.cursors.begin(), merged.cursors.end(), all) != merged.cursors.end();
  });
}

}  // namespace mapmend
