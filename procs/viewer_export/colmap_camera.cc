#include "procs/viewer_export/colmap_camera.h"

#include <algorithm>

namespace mapmend {
namespace {

ColmapCamera Make(const char* model, int id, const Camera& camera, const std::vector<double>& distortion) {
  ColmapCamera result{model, id, camera.width, camera.height, {camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5}};
  result.params.insert(result.params.end(), distortion.begin(), distortion.end());
  return result;
}

bool IsZero(const Camera& camera, int from, int to) {
  return std::all_of(camera.distortion.begin() + from, camera.distortion.begin() + to, [](double v) { return v == 0; });
}

}  // namespace

std::optional<ColmapCamera> ToColmapCamera(const Camera& camera) {
  const auto& d = camera.distortion;
  switch (camera.model) {
    case Camera::Model::kPinhole:
      if (IsZero(camera, 0, 5)) return Make("PINHOLE", 1, camera, {});
      if (d[4] == 0) return Make("OPENCV", 4, camera, {d[0], d[1], d[2], d[3]});
      return Make("FULL_OPENCV", 6, camera, {d[0], d[1], d[2], d[3], d[4], 0, 0, 0});
    case Camera::Model::kFisheye:
      return Make("OPENCV_FISHEYE", 5, camera, {d[0], d[1], d[2], d[3]});
    case Camera::Model::kRational:
      if (!IsZero(camera, 8, 14)) return std::nullopt;  // thin prism, tilt
      return Make("FULL_OPENCV", 6, camera, {d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7]});
    case Camera::Model::kFov:
      return Make("FOV", 7, camera, {d[0]});
    case Camera::Model::kThinPrismFisheye:
      return Make("THIN_PRISM_FISHEYE", 10, camera, {d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7]});
    default:
      return std::nullopt;
  }
}

ColmapCamera ToColmapCamera(const Pinhole& pinhole) {
  return {"PINHOLE", 1, pinhole.width, pinhole.height, {pinhole.fx, pinhole.fy, pinhole.cx + 0.5, pinhole.cy + 0.5}};
}

}  // namespace mapmend
