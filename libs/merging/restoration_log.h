#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/stream/ids.h"

// The merging process of the paper's section 3.6, told as its Table 1 tells it: which submaps have not been recovered
// yet (stack L1), and of which the map consists that is being tracked (L2).
namespace mapmend {

// What is known of a submap's time.
struct RestorableSubmap {
  SubmapKey key;
  int64_t begin_utime = 0;  // of its first keyframe ...
  int begin_frame = -1;
  bool ended = false;     // tracking of it
  int64_t end_utime = 0;  // of its last frame with a pose
};

// Two submaps that an accepted connection joins, from the first keyframe of the younger one on that is a connected
// frame: the current frame F of step 5.
struct RestorableConnection {
  int older = -1, younger = -1;  // indices of submaps
  int64_t utime = 0;
  int frame = -1;
};

struct RestorationStep {
  enum class Event { kNewMap, kMerge };

  Event event = Event::kNewMap;
  int64_t utime = 0;
  int frame = -1;
  int submap = -1;               // that has begun, or that was tracked when the maps were merged
  int lost = -1;                 // kNewMap: the submap of which tracking was lost just before it; -1: none
  std::vector<int> connections;  // kMerge: indices of those that joined what was apart
  // Afterwards. A map is the submaps that are merged, youngest first.
  std::vector<std::vector<int>> unrecovered;  // L1, in the order in which tracking left them
  std::vector<std::vector<int>> tracked;      // L2: one map, but when several vehicles fly at a time
};

// submaps: by age, those of one session in the order of its stream. What happens at the same time makes one step for
// all of it (a frame that is connected with two lost maps recovers both). Pure: equal input gives equal steps.
std::vector<RestorationStep> Restore(const std::vector<RestorableSubmap>& submaps,
                                     const std::vector<RestorableConnection>& connections);

// The paper's names of submaps by age: A, B, ... Z, AA, AB ...
std::string SubmapLetters(int index);
// "I-H-G", and "A, D-C-B", as in Table 1.
std::string MapLetters(const std::vector<int>& map);
std::string StackLetters(const std::vector<std::vector<int>>& maps);

}  // namespace mapmend
