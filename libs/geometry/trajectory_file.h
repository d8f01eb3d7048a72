#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "libs/base/time_unit.h"
#include "libs/geometry/rigid3.h"
#include "libs/geometry/similarity3.h"

// Trajectories and the text format of the TUM RGB-D benchmark (Sturm et al., IROS 2012): one pose a line,
// `t tx ty tz qx qy qz qw`, t in seconds, world_from_camera; lines that begin with # are comments.
namespace mapmend {

struct StampedPose {
  int64_t utime = 0;
  Rigid3 world_from_camera;
};
using Trajectory = std::vector<StampedPose>;

// Reads a TUM file. Times become microseconds exactly (the decimal text is shifted, never passed through a double).
// Throws std::runtime_error with one line that names the file, the line and what is wrong with it.
Trajectory ReadTrajectory(const std::string& path);

// Writes a TUM file with microsecond times (see WriteFile for how and for errors).
//   comment  one line put at the head after "# "; empty: none
void WriteTrajectory(const std::string& path, const Trajectory& trajectory, const std::string& comment);
std::string FormatTrajectory(const Trajectory& trajectory, const std::string& comment);

// "1525003606.000000"
std::string FormatSeconds(int64_t utime);

// The same trajectory in another world.
Trajectory TransformTrajectory(const Trajectory& trajectory, const Similarity3& new_from_world);

}  // namespace mapmend
