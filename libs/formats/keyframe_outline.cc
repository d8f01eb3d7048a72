#include "libs/formats/keyframe_outline.h"

#include "libs/base/median.h"

namespace mapmend {

double OutlineDepth(const PlacedMap& map) {
  std::vector<double> steps;
  for (size_t i = 1; i < map.keyframes.size(); ++i) {
    steps.push_back(
        (map.keyframes[i].world_from_camera.translation - map.keyframes[i - 1].world_from_camera.translation).norm());
  }
  const double step = Median(steps);
  return step > 0 ? step / 2 : 1;
}

std::array<Eigen::Vector3d, 16> KeyframeOutline(const PlacedMap& map, const PlacedPose& keyframe, double depth) {
  const Pinhole& camera = map.cameras[keyframe.session];
  const double w = camera.width, h = camera.height;
  std::array<Eigen::Vector3d, 4> corners;
  const std::array<Eigen::Vector2d, 4> pixels = {Eigen::Vector2d(0, 0), Eigen::Vector2d(w, 0), Eigen::Vector2d(w, h),
                                                 Eigen::Vector2d(0, h)};
  for (int i = 0; i < 4; ++i) corners[i] = keyframe.world_from_camera * (depth * camera.Unproject(pixels[i]));
  std::array<Eigen::Vector3d, 16> ends;
  for (int i = 0; i < 4; ++i) {
    ends[4 * i] = keyframe.world_from_camera.translation;
    ends[4 * i + 1] = ends[4 * i + 2] = corners[i];
    ends[4 * i + 3] = corners[(i + 1) % 4];
  }
  return ends;
}

}  // namespace mapmend
