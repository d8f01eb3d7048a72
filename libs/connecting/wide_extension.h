#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/wide_tracks.h"

namespace mapmend {

struct WideExtensionOptions {
  WideMatchingOptions matching;
  uint64_t seed = 1;
  double threshold_px = 4;           // of an inlier of P3P, at a sigma of 1 pixel
  double max_squared_error = 16;     // of a point, sigma^2: those at the end of a submap carry noise of their own
  int min_inliers = 20;              // points of the side that a frame's pose explains; four or five agree by chance
  int min_cells = 4;                 // of an 8 x 6 grid, occupied by them
  double max_position_sigma = 0.03;  // of the pose, of the points' median depth

  // Not visited: seed: that of the whole program.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("matching", matching);
    v("threshold_px", threshold_px, MoreThan(0), "pixels");
    v("max_squared_error", max_squared_error, MoreThan(0), "sigma^2");
    v("min_inliers", min_inliers, Range(6, 1e6), "points");
    v("min_cells", min_cells, Range(0, 48), "cells");
    v("max_position_sigma", max_position_sigma, MoreThan(0), "of the depth");
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// Photos that were taken between two submaps and not tracked: each that the points of the side explain gets a pose and
// joins it, with new points, so that the next may be reached from there. A landing that halves its height from photo to
// photo is followed like this. In the order given, the nearest to the side first; those that do not hold are left out.
// Their `keyframe` is to be one of the submap's, which stands for them. Returns how many joined.
int ExtendWideSide(std::vector<WideFrame> frames, const WideTrackOptions& tracks, const WideExtensionOptions& options,
                   WideSide* side);

}  // namespace mapmend
