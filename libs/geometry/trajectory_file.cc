#include "libs/geometry/trajectory_file.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <stdexcept>

#include "libs/base/write_file.h"

namespace mapmend {

std::string FormatSeconds(int64_t utime) {
  const uint64_t magnitude = utime < 0 ? -static_cast<uint64_t>(utime) : static_cast<uint64_t>(utime);
  char text[48];
  std::snprintf(text, sizeof(text), "%s%llu.%06llu", utime < 0 ? "-" : "",
                static_cast<unsigned long long>(magnitude / 1000000),
                static_cast<unsigned long long>(magnitude % 1000000));
  return text;
}

std::string FormatTrajectory(const Trajectory& trajectory, const std::string& comment) {
  std::string text = comment.empty() ? "" : "# " + comment + "\n";
  char line[256];
  for (const StampedPose& pose : trajectory) {
    const std::array<double, 7> v = ToArray(pose.world_from_camera);
    std::snprintf(line, sizeof(line), "%s %.10g %.10g %.10g %.10f %.10f %.10f %.10f\n",
                  FormatSeconds(pose.utime).c_str(), v[0], v[1], v[2], v[3], v[4], v[5], v[6]);
    text += line;
  }
  return text;
}

void WriteTrajectory(const std::string& path, const Trajectory& trajectory, const std::string& comment) {
  WriteFile(path, FormatTrajectory(trajectory, comment));
}

Trajectory TransformTrajectory(const Trajectory& trajectory, const Similarity3& new_from_world) {
  Trajectory result = trajectory;
  for (StampedPose& pose : result) {
    pose.world_from_camera = Rigid3(new_from_world.rotation * pose.world_from_camera.rotation,
                                    new_from_world * pose.world_from_camera.translation);
  }
  return result;
}

}  // namespace mapmend
