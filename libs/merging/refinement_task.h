#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "libs/connecting/keyframe_cache.h"
#include "libs/merging/merged_refinement.h"
#include "libs/stream/revision.h"

namespace mapmend {

// All that one refinement of the merged map needs: it can run in any thread while the merger goes on, but not longer
// than the merger lives. Submaps that have ended are the merger's own, which do not change any more; those that grow
// are copied. Of neither are features and vocabulary nodes looked at, which come and go (keyframe_cache.h): features
// are read from the store, those of a bounded number of keyframes at a time. A pure function.
struct RefinementTask {
  struct Part {
    std::shared_ptr<const Submap> submap;
    Pinhole camera;
    Pyramid pyramid;
    Camera real;
  };
  MergedTransforms transforms;        // where the tree puts every submap
  std::vector<Part> parts;            // as transforms.submaps
  std::vector<RefinementLink> links;  // submaps are indices into parts
  FlightPositions positions;          // by session
  MergedRefinementOptions options;
  int64_t state = 0;  // of the merger when the task was made
  bool is_final = false;
};

struct RefinementOutcome {
  MergedTransforms transforms;  // the places of the refined map; number, cursors and flags are as they were
  std::vector<RefinedSubmap> submaps;
  std::map<std::string, Shutter> shutters;  // rolling ones, per session, where one was found
  int64_t state = 0;
  bool is_final = false;
};

// Opens a connection to where keyframes are read from.
using OpenKeyframeSource = std::function<std::unique_ptr<KeyframeSource>()>;

// Refines each component by itself. progress is called now and then, in the caller's thread. open: null if the submaps
// hold their features.
RefinementOutcome RunRefinement(const RefinementTask& task, const std::function<void(const std::string&)>& progress,
                                const OpenKeyframeSource& open = {});

}  // namespace mapmend
