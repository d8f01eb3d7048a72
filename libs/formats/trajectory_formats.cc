#include "libs/formats/trajectory_formats.h"

#include "libs/base/text_format.h"
#include "libs/geometry/trajectory_file.h"

namespace mapmend {

std::string KittiPoses(const PlacedMap& map) {
  std::string text;
  for (const PlacedPose& pose : map.frames) {
    const Eigen::Matrix3d R = pose.world_from_camera.rotation.toRotationMatrix();
    const Eigen::Vector3d t = pose.world_from_camera.translation + map.frame.origin;
    for (int i = 0; i < 3; ++i)
      text += Format("%.12g %.12g %.12g %.12g%s", R(i, 0), R(i, 1), R(i, 2), t[i], i < 2 ? " " : "\n");
  }
  return text;
}

std::string KittiTimes(const PlacedMap& map) {
  std::string text;
  for (const PlacedPose& pose : map.frames) {
    text += FormatSeconds(pose.utime) + " " + std::to_string(pose.session) + " " + std::to_string(pose.frame) + "\n";
  }
  return text;
}

std::string EurocCsv(const PlacedMap& map) {
  const std::string unit = map.frame.unit == "m" ? "m" : "map unit";
  std::string text = "#timestamp [ns]";
  for (const char* axis : {"x", "y", "z"}) text += std::string(",p_RS_R_") + axis + " [" + unit + "]";
  for (const char* axis : {"w", "x", "y", "z"}) text += std::string(",q_RS_") + axis + " []";
  text += "\n";
  for (const PlacedPose& pose : map.frames) {
    const Eigen::Vector3d t = pose.world_from_camera.translation + map.frame.origin;
    const Eigen::Quaterniond& q = pose.world_from_camera.rotation;
    text += std::to_string(pose.utime) + "000" +
            Format(",%.12g,%.12g,%.12g,%.12g,%.12g,%.12g,%.12g\n", t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z());
  }
  return text;
}

}  // namespace mapmend
