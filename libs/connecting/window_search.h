#pragma once

#include <vector>

#include "libs/connecting/connected_frames.h"
#include "libs/connecting/guided_projection.h"
#include "libs/connecting/local_window.h"
#include "libs/features/matching.h"

// The guided part of the verification of connected frames: with a transform between two submaps, the map points of one
// window of keyframes are projected into the keyframes of the other.
namespace mapmend {

// Everything a window knows of its map points: each point as the earliest keyframe of the window sees it.
struct WindowAppearance {
  std::vector<PointAppearance> points;
  std::vector<Eigen::Quaterniond> rotations;
};

// One side of a pair: the keyframe asked about first, then its window. Appearances and grids are made when they are
// needed.
struct Side {
  SubmapView view;
  KeyframeWindow window;
  WindowAppearance appearance = {};
  std::vector<FeatureGrid> grids = {};

  // For searches in the first num_searched keyframes.
  void Prepare(int num_searched);
  const SubmapKeyframe& Asked() const { return *window[0]; }
};

struct Sides {
  Side a, b;
  bool same_submap = false;
};

struct GuidedMatches {
  std::vector<CrossMatch> matches;
  int num_expected = 0;  // in the first keyframe of the window
};

// Points of the source looked for in the first keyframes of the target window, as many as there are grids.
//   radius  pixels at octave 0
GuidedMatches SearchWindow(const Side& source, const Similarity3& target_from_source, const Side& target, double radius,
                           bool same_submap, const ConnectedFramesOptions& options);

}  // namespace mapmend
