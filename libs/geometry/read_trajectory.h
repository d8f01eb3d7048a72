#pragma once

#include <string>
#include <vector>

#include "libs/geometry/trajectory_file.h"

// Trajectories in the formats people have ground truth in.
namespace mapmend {

struct TrajectoryFile {
  Trajectory poses;           // rotations are those of no turn where the file has none
  std::string format;         // for a person
  bool has_rotations = true;  // false: positions only
  int num_left_out = 0;       // lines with a number that is none (nan)
  std::string note;           // one line for the user if the file is not plainly of TUM's format; else empty
};

// Reads one pose a line, told apart by the number of columns and by their names, if a head has them:
//   8   TUM: t tx ty tz qx qy qz qw, world_from_camera; a quaternion of four zeros is a position without rotation
//   4   positions: t x y z
//   16  and more, or names with w before x: EuRoC's csv: t, p, q w x y z, ...
//   12  KITTI: a matrix of 3 x 4, row by row, without times: one pose for each of frame_times
// Blanks, commas or semicolons between columns; times in any unit of GuessTimeUnit, in seconds exact to the
// microsecond. Throws std::runtime_error with one line that names the file, the line and what is wrong with it.
TrajectoryFile ReadTrajectoryFile(const std::string& path, const std::vector<int64_t>& frame_times = {});

// The ground truth of a flight.
//   times_path     of the frames, for KITTI's format; empty: unknown
//   time_offset_s  seconds to add to its times
TrajectoryFile ReadGroundTruth(const std::string& path, const std::string& times_path, double time_offset_s);

}  // namespace mapmend
