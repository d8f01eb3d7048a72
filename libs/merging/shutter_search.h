#pragma once

#include <string>

#include "libs/base/range.h"
#include "libs/merging/merged_bundle_adjustment.h"

namespace mapmend {

struct ShutterSearchOptions {
  bool use = true;
  int iterations = 12;
  int points_per_keyframe = 250;  // as MergedBundleOptions'
  // A readout time is believed if it lowers a flight's cost by this fraction and so much (chance: 2) ...
  double min_gain = 0.01;  // 0.002 to 0.006 where all rows were read at once, 0.015 to 0.2 elsewhere
  double min_drop = 20;
  // ... is one that there could be, seconds, either way: a camera may be mounted upside down ...
  double min_readout = 0.002, max_readout = 0.1;
  // ... is the same in both halves of the flight, but for this share of it, if either tells so much of it ...
  double max_difference = 0.35;
  double min_share_of_half = 0.15;
  // ... and still lowers the cost by this fraction when another lens (focal length, distortion) may explain the images.
  double min_gain_beside_lens = 0.005;
  int lens_iterations = 15;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("use", use);
    v("iterations", iterations, Range(1, 10000));
    v("points_per_keyframe", points_per_keyframe, Range(0, 1e6), "points; 0: all");
    v("min_gain", min_gain, Range(0, 1), "of the cost");
    v("min_drop", min_drop, AtLeast(0), "of the cost");
    v("min_readout", min_readout, AtLeast(0), "s");
    v("max_readout", max_readout, AtLeast(0), "s");
    v("max_difference", max_difference, AtLeast(0), "of the readout time");
    v("min_share_of_half", min_share_of_half, Range(0, 1));
    v("min_gain_beside_lens", min_gain_beside_lens, Range(0, 1), "of the cost");
    v("lens_iterations", lens_iterations, Range(1, 10000));
  }
};

struct ShutterFindings {
  bool found = false;  // of any flight
  std::string told;    // one sentence: what was found of each flight, or why it was ruled out
};

// Looks for the rolling shutter of each flight in a map that is adjusted already: rows or columns, in either direction,
// or none. Readout times are unknowns of a bundle adjustment, one for each half of a flight, with rows and with
// columns; that which explains a flight's images better has to stand the questions of the options. If one does, the map
// gets its shutters and the poses and points that belong to them, else it stays as it is.
ShutterFindings FindShutters(const MergedBundleOptions& bundle, const ShutterSearchOptions& options, MergedMap* map);

}  // namespace mapmend
