#pragma once

#include <list>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "libs/features/matching.h"
#include "libs/merging/merged_map.h"

namespace mapmend {

// What it takes to find map points in a keyframe.
struct SearchedKeyframe {
  std::shared_ptr<const Features> features;
  FeatureGrid grid;
};

// The keyframes of a merged map as they are searched, at most `capacity` of them at a time (some 55 KB each with 1000
// features): what a search takes in memory does not grow with the map. Keyframes that are searched together lie side by
// side, so few are read twice.
class SearchedKeyframes {
 public:
  static constexpr int kCapacity = 300;

  explicit SearchedKeyframes(const MergedMap& map, OpenFeatureSource open = {}, int capacity = kCapacity)
      : map_(map), reader_(std::move(open)), capacity_(capacity) {}

  std::shared_ptr<const SearchedKeyframe> Get(int keyframe);
  // Closes the source. What has been read stays.
  void Close() { reader_.Close(); }

 private:
  struct Entry {
    int keyframe = -1;
    std::shared_ptr<const SearchedKeyframe> searched;
  };

  const MergedMap& map_;
  FeatureReader reader_;
  const int capacity_;
  std::list<Entry> entries_;  // used last first
  std::unordered_map<int, std::list<Entry>::iterator> position_;
};

}  // namespace mapmend
