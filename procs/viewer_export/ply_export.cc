#include "procs/viewer_export/ply_export.h"

#include "libs/formats/little_endian.h"
#include "procs/viewer_export/submap_color.h"

namespace mapmend {
namespace {

constexpr int kPathPointsPerFrame = 8;

class PlyFile {
 public:
  explicit PlyFile(const std::string& comment) : comment_(comment) {}

  void Add(const Eigen::Vector3d& position, const std::array<uint8_t, 3>& color) {
    for (int i = 0; i < 3; ++i) Append(static_cast<float>(position[i]), &vertices_);
    for (const uint8_t c : color) Append(c, &vertices_);
    ++count_;
  }

  std::string Text() const {
    return "ply\nformat binary_little_endian 1.0\ncomment mapmend: " + comment_ + "\nelement vertex " +
           std::to_string(count_) +
           "\nproperty float x\nproperty float y\nproperty float z\n"
           "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n" +
           vertices_;
  }

 private:
  std::string comment_, vertices_;
  size_t count_ = 0;
};

}  // namespace

std::string MakePly(const Snapshot& snapshot, int component) {
  PlyFile file("map points");
  for (const ColoredPoint& point : ComponentPoints(snapshot, component)) file.Add(point.position, point.color);
  return file.Text();
}

std::string MakeCamerasPly(const Snapshot& snapshot, int component) {
  PlyFile file("camera path, in the colours of the submaps");
  for (const int index : snapshot.components[component].submaps) {
    const SnapshotSubmap& submap = snapshot.submaps[index];
    const std::array<uint8_t, 3> color = SubmapColor(submap.number);
    for (size_t i = 0; i < submap.frames.size(); ++i) {
      const Eigen::Vector3d center = submap.frames[i].cam_from_root.Center();
      // The way to the next frame; none where frames are missing in between.
      const bool joined = i + 1 < submap.frames.size() && submap.frames[i + 1].frame == submap.frames[i].frame + 1;
      const Eigen::Vector3d next = joined ? submap.frames[i + 1].cam_from_root.Center() : center;
      for (int k = 0; k < (joined ? kPathPointsPerFrame : 1); ++k) {
        file.Add(center + (next - center) * k / kPathPointsPerFrame, color);
      }
    }
  }
  return file.Text();
}

}  // namespace mapmend
