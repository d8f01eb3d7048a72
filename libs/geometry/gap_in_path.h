#pragma once

#include <vector>

#include "libs/geometry/rigid3.h"

// How a camera most likely moved while nothing was tracked: dead reckoning from its motion before and behind.
namespace mapmend {

struct PathPose {
  double seconds = 0;
  Rigid3 world_from_cam;
};

// The way across a gap between two paths of one camera, each in a world and a unit of its own: it goes on as at the end
// of the first one, then as at the beginning of the second one, with half of the time for each. A camera that turned or
// moved evenly before and after is found exactly.
struct BridgedGap {
  bool success = false;  // false: a path is too short, or stands still, or there is no time in between
  double seconds = 0;
  // Between the last camera of the first path and the first one of the second path, units of the first.
  Rigid3 before_from_after;
  double scale = 1;  // length of one unit of the second path in those of the first, from equal speed
  // One sigma, by what the same guess does wrong across pieces of the two paths that are as long as the gap, or, if
  // they are too short for that, across shorter ones, as if an acceleration had been overlooked.
  double sigma_position = 0;  // units of the first path
  double sigma_angle = 0;     // radians
  double sigma_scale = 0;     // of its natural logarithm
};
BridgedGap BridgeGap(const std::vector<PathPose>& before, const std::vector<PathPose>& after);

}  // namespace mapmend
