#pragma once

#include <cstdint>
#include <optional>
#include <string>

// The words of the progress line.
namespace mapmend {

// How far a flight is, from the health of frontend and merger.
struct FlightProgress {
  double frames = 0, frames_total = 0;  // frames_total 0: nobody knows
  double fps = 0;
  int submaps = 0, connections = 0;
  int64_t dropped = 0, refused = 0;
  // The last loss of tracking; found_frame is unset while it lasts.
  std::optional<int> lost_frame, found_frame;
  int64_t lost_utime = 0;
  double merging_s = 0;  // what is left to do after the last frame, as far as can be told
};

// "87/162 frames, 0:04 left and 0:05 of merging, lost after frame 73 (12:17:30), again from 84, 2 submaps, ...": what
// matters most comes first, because the end is cut off on a narrow terminal.
std::string DescribeFlight(const FlightProgress& progress);

// "merging, about 0:12 left: 3 connections, 2 in use, 2 parts"
//   estimate_s  when it began; elapsed_s since then
std::string DescribeMerging(int connections, int in_use, int parts, double estimate_s, double elapsed_s);

}  // namespace mapmend
