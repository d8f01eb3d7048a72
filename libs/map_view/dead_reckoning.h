#pragma once

#include <string>
#include <vector>

#include "libs/geometry/gap_in_path.h"
#include "libs/geometry/similarity3.h"
#include "libs/map_view/snapshot.h"

// Where the camera was most likely after a loss that no connection bridges: a guess, never part of the merged map.
namespace mapmend {

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
