#include "libs/geometry/trajectory_file.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <stdexcept>

#include "libs/geometry/write_file.h"

namespace mapmend {
namespace {

constexpr int kFields = 8;
constexpr std::string_view kBlank = " \t\r";

// Splits at blanks; stops after kFields + 1 fields, enough to see that there are too many.
std::vector<std::string_view> SplitFields(std::string_view line) {
  std::vector<std::string_view> fields;
  size_t at = line.find_first_not_of(kBlank);
  while (at != std::string_view::npos && fields.size() <= kFields) {
    const size_t end = std::min(line.find_first_of(kBlank, at), line.size());
    fields.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(kBlank, end);
  }
  return fields;
}

// What is wrong with the line, or empty.
std::string ParseLine(const std::vector<std::string_view>& fields, StampedPose* pose) {
  if (fields.size() != kFields) {
    const std::string found = fields.size() > kFields ? "more" : std::to_string(fields.size());
    return "expected 8 numbers (t tx ty tz qx qy qz qw), found " + found;
  }
  if (!ParseSeconds(fields[0], &pose->utime)) return "bad time '" + std::string(fields[0]) + "'";
  std::array<double, 7> values;
  for (int i = 0; i < 7; ++i) {
    const std::string_view field = fields[i + 1];
    const auto [end, error] = std::from_chars(field.data() + (field[0] == '+'), field.data() + field.size(), values[i]);
    if (error != std::errc() || end != field.data() + field.size() || !std::isfinite(values[i])) {
      return "bad number '" + std::string(field) + "'";
    }
  }
  const double norm = Eigen::Map<const Eigen::Vector4d>(values.data() + 3).norm();
  if (std::abs(norm - 1.0) > 0.01) return "the quaternion's length is " + std::to_string(norm) + ", not 1";
  pose->world_from_camera = RigidFromArray(values.data());
  return "";
}

}  // namespace

std::string FormatSeconds(int64_t utime) {
  const uint64_t magnitude = utime < 0 ? -static_cast<uint64_t>(utime) : static_cast<uint64_t>(utime);
  char text[48];
  std::snprintf(text, sizeof(text), "%s%llu.%06llu", utime < 0 ? "-" : "",
                static_cast<unsigned long long>(magnitude / 1000000),
                static_cast<unsigned long long>(magnitude % 1000000));
  return text;
}

Trajectory ReadTrajectory(const std::string& path) {
  const std::string content = ReadFile(path);
  Trajectory trajectory;
  std::string_view rest = content;
  for (int line_number = 1; !rest.empty(); ++line_number) {
    const size_t end = std::min(rest.find('\n'), rest.size());
    const std::vector<std::string_view> fields = SplitFields(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (fields.empty() || fields[0][0] == '#') continue;
    StampedPose pose;
    const std::string problem = ParseLine(fields, &pose);
    if (!problem.empty()) throw std::runtime_error(path + ":" + std::to_string(line_number) + ": " + problem);
    trajectory.push_back(pose);
  }
  if (trajectory.empty()) throw std::runtime_error(path + ": no poses (expected lines `t tx ty tz qx qy qz qw`)");
  return trajectory;
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
