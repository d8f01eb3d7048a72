#include "libs/connecting/keyframe_cache.h"

#include <stdexcept>
#include <utility>

namespace mapmend {
namespace {

template <typename T>
void Release(std::vector<T>* values) {
  std::vector<T>().swap(*values);
}

}  // namespace

WideFeaturesRecord KeyframeSource::ReadWide(const std::string& session, int64_t seq) {
  throw std::runtime_error("there is no place to read wide features from, record " + std::to_string(seq) +
                           " of session " + session);
}

bool KeyframeCache::IsComplete(const SubmapKeyframe& keyframe) {
  return keyframe.features.keypoints.size() == keyframe.map_points.size();
}

SubmapKeyframe* KeyframeCache::Find(const Key& key) {
  const auto& [submap, keyframe] = key;
  auto& keyframes = sessions_->at(submap.session).submaps.at(submap.submap).keyframes;
  const auto it = keyframes.find(keyframe);
  return it == keyframes.end() ? nullptr : &it->second;  // culled since
}

void KeyframeCache::Add(const SubmapKey& submap, KeyframeId keyframe) {
  SubmapKeyframe* added = Find({submap, keyframe});
  if (added == nullptr) return;
  Release(&added->words);  // retrieval is the store's
  Release(&added->features.colors);
  added->bow = {};
  Touch({submap, keyframe});
}

void KeyframeCache::Load(const SubmapKey& submap, const std::vector<const SubmapKeyframe*>& keyframes) {
  for (const SubmapKeyframe* wanted : keyframes) {
    const Key key{submap, wanted->id};
    SubmapKeyframe* keyframe = Find(key);
    if (!IsComplete(*keyframe)) Complete(submap.session, keyframe);
    Touch(key);
  }
}

void KeyframeCache::Complete(const std::string& session, SubmapKeyframe* keyframe) {
  KeyframeRecord record = source_->Read(session, keyframe->seq);
  ++num_reads_;
  if (record.keyframe != keyframe->id || record.features.keypoints.size() != keyframe->map_points.size()) {
    throw std::runtime_error("the store has another keyframe under record " + std::to_string(keyframe->seq) +
                             " of session " + session);
  }
  keyframe->features = std::move(record.features);
  Release(&keyframe->features.colors);
  keyframe->nodes = std::move(record.nodes);
}

void KeyframeCache::Touch(const Key& key) {
  const auto it = position_.find(key);
  if (it != position_.end()) {
    order_.splice(order_.begin(), order_, it->second);
    return;
  }
  order_.push_front(key);
  position_[key] = order_.begin();
  while (static_cast<int>(order_.size()) > capacity_) {
    const Key last = order_.back();
    if (SubmapKeyframe* keyframe = Find(last)) {
      keyframe->features = {};
      Release(&keyframe->nodes);
    }
    position_.erase(last);
    order_.pop_back();
  }
}

}  // namespace mapmend
