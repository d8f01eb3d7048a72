#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "procs/viewer_export/snapshot.h"

namespace mapmend {

// Frames of a flight that the main map lacks, whatever the reason: not tracked, tracked in another part, dropped, left
// out. A map in one piece may have holes: two submaps that are joined by their ground bridge the time between them.
struct MapHole {
  int session = 0;                      // index into MapModel::SessionOrder
  int first_frame = 0, last_frame = 0;  // numbers in the input, both lacking
  int64_t duration_us = 0;              // between the frames of the map before and after it; 0: not known
  int NumFrames() const { return last_frame - first_frame + 1; }
};

// In the order of sessions and frames. A hole at the end of a flight is known only if the flight's number of frames is.
std::vector<MapHole> FindHoles(const Snapshot& snapshot);

// "no holes", "1 hole: frames 74 to 83 (10 frames, 66 s)", "3 holes, 31 frames in all; the longest: ...".
std::string DescribeHoles(const std::vector<MapHole>& holes);

}  // namespace mapmend
