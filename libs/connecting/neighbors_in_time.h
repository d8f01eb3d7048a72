#pragma once

#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/stream/submap.h"

namespace mapmend {

struct NeighborsInTimeOptions {
  int num_keyframes = 5;  // at the beginning of a submap and at the end of an earlier one
  int num_submaps = 2;    // earlier ones: between two good submaps there is often a short, bad one

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("num_keyframes", num_keyframes, Range(0, 10000), "keyframes");
    v("num_submaps", num_submaps, Range(0, 10000), "submaps");
  }
};

// Candidates that need no retrieval: where a submap begins, its camera has often not gone far since an earlier submap
// of the session ended, and looks at the same ground. Bag of words does not see it where much else in the scene looks
// alike. Of a keyframe among the first of its submap, per earlier submap, latest first: the last keyframes, latest
// first. By the time of their images; submaps that have not ended, and other keyframes, have no such neighbours.
std::vector<std::pair<SubmapId, std::vector<KeyframeId>>> NeighborsInTime(const Session& session, SubmapId submap,
                                                                          KeyframeId keyframe,
                                                                          const NeighborsInTimeOptions& options);

}  // namespace mapmend
