#pragma once

#include <string>
#include <vector>

#include "libs/stream/submap.h"

namespace mapmend {

// A submap with what is needed to project into its keyframes.
struct SubmapView {
  const Submap* submap = nullptr;
  Pinhole camera;
  Pyramid pyramid;
  Camera real = {};         // what `camera` is the ideal of; without a height, as if it were the ideal one
  std::string flight = {};  // the session; submaps of one flight have one shutter
};

// A keyframe of the same submap and the number of map points it shares with another.
struct CovisibleKeyframe {
  const SubmapKeyframe* keyframe = nullptr;
  int num_shared = 0;
};

// Keyframes that share at least min_shared map points with keyframe, most first (ties: lower id), without itself.
std::vector<CovisibleKeyframe> FindCovisible(const Submap& submap, const SubmapKeyframe& keyframe, int min_shared);

// The keyframe itself, then its size - 1 most covisible ones.
std::vector<const SubmapKeyframe*> LocalWindow(const Submap& submap, KeyframeId keyframe, int size,
                                               int min_shared = 15);

// Median depth of the map points that the keyframe observes, submap units; 0 if it observes none.
double MedianDepth(const Submap& submap, const SubmapKeyframe& keyframe);

}  // namespace mapmend
