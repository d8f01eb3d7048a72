#pragma once

#include <vector>

#include "libs/base/range.h"
#include "libs/merging/merged_map.h"

namespace mapmend {

struct SeamWindowOptions {
  int window_size = 300;  // keyframes
  int max_windows = 12;   // at most: this bounds the time

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("window_size", window_size, Range(2, 1e6), "keyframes");
    v("max_windows", max_windows, Range(1, 10000), "windows");
  }
};

// Seams of a merged map are where submaps, or far-apart parts of one, have been joined: keyframes that see fused
// points. Bundle adjustment has something to do there; elsewhere it was done when the submap was tracked. Returns
// windows of keyframes (ascending, none in two windows) which together hold the keyframes at seams. Each grows from the
// keyframe that sees most such points and is in no window yet, along the points in common, most first. Deterministic.
std::vector<std::vector<int>> ChooseSeamWindows(const MergedMap& map, const SeamWindowOptions& options);

}  // namespace mapmend
