#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libs/mapping/merged_refinement.h"
#include "procs/merger/merged_revision.h"

namespace mapmend {

// All that one refinement of the merged map needs, copied: it can run in any thread while the merger goes on. A pure
// function.
struct RefinementTask {
  struct Part {
    Submap submap;
    Pinhole camera;
    Pyramid pyramid;
  };
  struct Link {
    int submap_a = -1, submap_b = -1;  // indices into parts; equal for a loop within a submap
    KeyframeId keyframe_a, keyframe_b;
    Similarity3 b_from_a;
    bool robust = true;  // as RefinementLink
  };
  MergedTransforms transforms;  // where the tree puts every submap
  std::vector<Part> parts;      // as transforms.submaps
  std::vector<Link> links;
  MergedRefinementOptions options;
  int64_t state = 0;  // of the merger when the task was made
  bool is_final = false;
};

struct RefinementOutcome {
  MergedTransforms transforms;  // the places of the refined map; number, cursors and flags are as they were
  std::vector<RefinedSubmap> submaps;
  int64_t state = 0;
  bool is_final = false;
};

// Refines each component by itself, and frees of the task what it has done with: a component's descriptors once its
// points are matched. progress is called now and then, in the caller's thread.
RefinementOutcome RunRefinement(RefinementTask task, const std::function<void(const std::string&)>& progress);

}  // namespace mapmend
