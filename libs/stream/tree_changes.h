#pragma once

#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "libs/stream/revision.h"

namespace mapmend {

// A connection that came into the tree by which submaps are joined, or left it.
struct TreeChange {
  std::string session_a, session_b;
  int submap_a = -1, submap_b = -1;
  bool joined = false;
};

// Compares the places of the submaps, each time that they are told, with those before.
class TreeChanges {
 public:
  // What has changed; those that left come first.
  std::vector<TreeChange> Update(const MergedTransforms& transforms);

 private:
  using Edge = std::tuple<std::string, int, std::string, int>;
  std::set<Edge> edges_;
};

// "submap 0 and submap 1", with the beginning of their sessions' names if they are not of one.
std::string DescribePair(const TreeChange& change);

}  // namespace mapmend
