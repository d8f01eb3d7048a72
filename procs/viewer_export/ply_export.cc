#include "procs/viewer_export/ply_export.h"

#include <bit>
#include <cstring>

#include "libs/drawing/canvas.h"

namespace mapmend {
namespace {

constexpr int kPathPointsPerFrame = 8;

void AppendVertex(const Eigen::Vector3d& position, const std::array<uint8_t, 3>& color, std::string* bytes) {
  static_assert(std::endian::native == std::endian::little);
  for (int i = 0; i < 3; ++i) {
    const float value = static_cast<float>(position[i]);
    char raw[sizeof(float)];
    std::memcpy(raw, &value, sizeof(raw));
    bytes->append(raw, sizeof(raw));
  }
  for (const uint8_t c : color) bytes->push_back(static_cast<char>(c));
}

std::array<uint8_t, 3> ParseColor(const std::string& color) {
  const unsigned long rgb = std::stoul(color.substr(1), nullptr, 16);
  return {static_cast<uint8_t>(rgb >> 16), static_cast<uint8_t>(rgb >> 8), static_cast<uint8_t>(rgb)};
}

}  // namespace

std::string MakePly(const Snapshot& snapshot, int component) {
  std::string vertices;
  size_t count = 0;
  for (const ColoredPoint& point : ComponentPoints(snapshot, component)) {
    AppendVertex(point.position, point.color, &vertices);
    ++count;
  }
  for (const int index : snapshot.components[component].submaps) {
    const SnapshotSubmap& submap = snapshot.submaps[index];
    const std::array<uint8_t, 3> color = ParseColor(CategoryColor(submap.number));
    for (size_t i = 0; i < submap.frames.size(); ++i) {
      const Eigen::Vector3d center = submap.frames[i].cam_from_root.Center();
      // The way to the next frame; none where frames are missing in between.
      const bool joined = i + 1 < submap.frames.size() && submap.frames[i + 1].frame == submap.frames[i].frame + 1;
      const Eigen::Vector3d next = joined ? submap.frames[i + 1].cam_from_root.Center() : center;
      for (int k = 0; k < (joined ? kPathPointsPerFrame : 1); ++k) {
        AppendVertex(center + (next - center) * k / kPathPointsPerFrame, color, &vertices);
        ++count;
      }
    }
  }
  return "ply\nformat binary_little_endian 1.0\ncomment mapmend: map points, then the camera path\nelement vertex " +
         std::to_string(count) +
         "\nproperty float x\nproperty float y\nproperty float z\n"
         "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n" +
         vertices;
}

}  // namespace mapmend
