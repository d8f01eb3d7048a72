#pragma once

#include <string>
#include <vector>

#include "libs/geometry/similarity3.h"
#include "libs/map_view/snapshot.h"

// Where the camera was most likely after a loss that no connection bridges: a guess, never part of the merged map.
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

// Two submaps that follow each other in a flight, in parts of the map that nothing joins.
struct LikelyPlace {
  int earlier = 0, later = 0;           // indices into Snapshot::submaps
  int last_frame = 0, first_frame = 0;  // of the earlier and of the later one
  BridgedGap gap;
  Similarity3 earlier_from_later;  // between the frames of their components
};
std::vector<LikelyPlace> FindLikelyPlaces(const Snapshot& snapshot);

// "if the camera went on as before and behind it, frame 84 was 3.4 (± 0.9) map units from frame 73"
std::string DescribeLikelyPlace(const LikelyPlace& place, const Snapshot& snapshot);

}  // namespace mapmend
