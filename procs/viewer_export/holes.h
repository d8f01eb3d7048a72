#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/map_view/snapshot.h"

namespace mapmend {

// Frames of a flight that the main map lacks, whatever the reason: not tracked, tracked in another part, dropped, left
// out. A map in one piece may have holes: two submaps that are joined by their ground bridge the time between them.
struct MapHole {
  int session = 0;          // index into MapModel::SessionOrder
  int first_frame = 0;      // number in the input, lacking
  int last_frame = 0;       // -1: up to the end of the flight
  int num_frames = 0;       // fewer than these span where only every so manyth frame was mapped; 0: not known
  int64_t duration_us = 0;  // between the frames of the map, or the ends of the flight, before and after it
};

// In the order of sessions and frames.
std::vector<MapHole> FindHoles(const Snapshot& snapshot);

// The same for frames that no component has.
std::vector<MapHole> FindHolesOfAll(const Snapshot& snapshot);

// "no holes", "1 hole: frames 74 to 83 (10 frames, 66 s)", "3 holes; the longest: ...".
std::string DescribeHoles(const std::vector<MapHole>& holes);

}  // namespace mapmend
