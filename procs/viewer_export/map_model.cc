#include "procs/viewer_export/map_model.h"

#include <algorithm>
#include <utility>

namespace mapmend {

std::string MapModel::Apply(const Record& record) {
  const std::string& id = record.header.session;
  const bool known = sessions_.contains(id);
  const std::string problem = sessions_[id].Apply(record);
  if (!problem.empty()) {
    if (!known) sessions_.erase(id);
    return problem;
  }
  if (!known) session_order_.push_back(id);
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

bool MapModel::SetMergedMap(MergedMap map) {
  if (map.revision < merged_.revision) return false;
  merged_ = std::move(map);
  return true;
}

void MapModel::SetConnection(const EvaluatedConnection& connection) {
  const auto same_pair = [&](const EvaluatedConnection& other) {
    return (other.a == connection.a && other.b == connection.b) || (other.a == connection.b && other.b == connection.a);
  };
  const auto it = std::find_if(merged_.connections.begin(), merged_.connections.end(), same_pair);
  if (it == merged_.connections.end()) {
    merged_.connections.push_back(connection);
  } else {
    *it = connection;
  }
}

int64_t MapModel::KeyframeUtime(const std::string& session, KeyframeId keyframe) const {
  return keyframe_utimes_.at(session).at(keyframe);
}

bool MapModel::AllEnded() const {
  return !sessions_.empty() &&
         std::all_of(sessions_.begin(), sessions_.end(), [](const auto& entry) { return entry.second.ended; });
}

}  // namespace mapmend
