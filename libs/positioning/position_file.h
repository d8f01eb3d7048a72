#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libs/positioning/position_fix.h"
#include "libs/positioning/world_frame.h"

namespace mapmend {

// What a file of positions says.
struct PositionFile {
  std::vector<PositionFix> fixes;    // in the order of time, if they have times
  std::vector<std::string> names;    // of each fix's image, without folder; empty: the file names none
  bool has_times = true;             // false: only names tell where fixes belong
  bool since_first_frame = false;    // times count from the first frame of the video (subtitles)
  std::string format;                // for a person: "GPX"
  std::vector<std::string> refused;  // a line for each fix that is no good: "line 12: a jump of 2000 m in 1.0 s"
};

// Reads positions; the content says which format it is:
//   tables with names of columns (the simulator's, exiftool's -csv, ...); geo.txt of OpenDroneMap; GPX; NMEA; subtitles
//   of DJI cameras; rows `t east north up`, which need an origin, given here or by a comment "# origin: LAT LON ALT".
// Throws std::runtime_error with one line that names the file if it cannot be read, is none of these, or holds not one
// usable fix.
PositionFile ReadPositions(const std::string& path, const std::optional<Geodetic>& origin = std::nullopt);

// "172 positions (CSV), 3 refused: line 12: ..., ...", for a person.
std::string DescribePositions(const PositionFile& file);

}  // namespace mapmend
