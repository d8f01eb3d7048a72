#pragma once

#include <functional>
#include <list>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "libs/features/matching.h"
#include "libs/mapping/merged_map.h"

namespace mapmend {

// Where the descriptors of keyframes come from that are not in memory.
class DescriptorSource {
 public:
  virtual ~DescriptorSource() = default;
  // Of a keyframe of the submap with this index in the merged map. Throws std::runtime_error if they cannot be had.
  virtual std::vector<Descriptor> Read(int submap, const SubmapKeyframe& keyframe) = 0;
};
// Opens such a source when there is something to read. It is closed again when a search is over: connections that
// nobody looks after would fill up.
using OpenDescriptorSource = std::function<std::unique_ptr<DescriptorSource>()>;

// What it takes to find map points in a keyframe.
struct SearchedKeyframe {
  std::vector<Descriptor> read;  // empty if they were in memory
  const std::vector<Descriptor>* descriptors = nullptr;
  FeatureGrid grid;
};

// The keyframes of a merged map as they are searched, at most `capacity` of them at a time (some 40 KB each with 1000
// features): what a search takes in memory does not grow with the map. Keyframes that are searched together lie side by
// side, so few are read twice.
class SearchedKeyframes {
 public:
  static constexpr int kCapacity = 300;

  // open: null if all descriptors are in the map's submaps; else those there are never looked at.
  explicit SearchedKeyframes(const MergedMap& map, OpenDescriptorSource open = {}, int capacity = kCapacity)
      : map_(map), open_(std::move(open)), capacity_(capacity) {}

  std::shared_ptr<const SearchedKeyframe> Get(int keyframe);
  // Closes the source. What has been read stays.
  void Close() { source_.reset(); }

 private:
  struct Entry {
    int keyframe = -1;
    std::shared_ptr<const SearchedKeyframe> searched;
  };

  const MergedMap& map_;
  const OpenDescriptorSource open_;
  const int capacity_;
  std::unique_ptr<DescriptorSource> source_;
  std::list<Entry> entries_;  // used last first
  std::unordered_map<int, std::list<Entry>::iterator> position_;
};

}  // namespace mapmend
