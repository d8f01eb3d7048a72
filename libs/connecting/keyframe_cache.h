#pragma once

#include <list>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "libs/stream/submap.h"

namespace mapmend {

// Where the parts of a keyframe come from that are not kept: the store, over the bus; in tests, anything.
class KeyframeSource {
 public:
  virtual ~KeyframeSource() = default;
  // The record of a keyframe. Throws std::runtime_error if it cannot be had.
  virtual KeyframeRecord Read(const std::string& session, int64_t seq) = 0;
  // Wide features, likewise.
  virtual WideFeaturesRecord ReadWide(const std::string& session, int64_t seq);
};

// Bounds what keyframes take in memory: features and vocabulary nodes, the bulk of a keyframe, are held of the
// `capacity` keyframes that were used last and read again of the others when they are needed. Pose and map points are
// always there. What a keyframe's record says of its features never changes, so results do not depend on the capacity.
class KeyframeCache {
 public:
  // source: may be null; then what is not held cannot be had.
  KeyframeCache(int capacity, KeyframeSource* source, std::map<std::string, Session>* sessions)
      : capacity_(capacity), source_(source), sessions_(sessions) {}

  // A keyframe that has just been added to its submap, complete. What nobody downstream asks for is dropped for good.
  void Add(const SubmapKey& submap, KeyframeId keyframe);
  // Makes these keyframes of a submap complete. At most `capacity` at a time; they stay so until as many others were
  // loaded.
  void Load(const SubmapKey& submap, const std::vector<const SubmapKeyframe*>& keyframes);

  KeyframeSource* source() const { return source_; }
  int num_loaded() const { return static_cast<int>(order_.size()); }
  int64_t num_reads() const { return num_reads_; }

 private:
  using Key = std::tuple<SubmapKey, KeyframeId>;
  static bool IsComplete(const SubmapKeyframe& keyframe);
  void Complete(const std::string& session, SubmapKeyframe* keyframe);
  void Touch(const Key& key);
  SubmapKeyframe* Find(const Key& key);

  const int capacity_;
  KeyframeSource* source_;
  std::map<std::string, Session>* sessions_;
  std::list<Key> order_;  // used last first
  std::map<Key, std::list<Key>::iterator> position_;
  int64_t num_reads_ = 0;
};

}  // namespace mapmend
