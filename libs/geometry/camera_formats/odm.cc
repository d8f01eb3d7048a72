#include <algorithm>

#include "libs/geometry/camera_formats/camera_format.h"

// OpenDroneMap's cameras.json, and OpenSfM's camera_models.json, which is the same: numbers in units of the larger side
// of the image, from its middle.
namespace mapmend {

bool IsOdm(const CameraText& file) {
  if (!file.yaml.IsMap()) return false;
  for (const auto& entry : file.yaml) {
    if (CameraKeys(entry.second, "").Has("projection_type")) return true;
  }
  return false;
}

CameraFile ReadOdm(const CameraText& file) {
  CameraFile result;
  std::string name;
  YAML::Node taken;
  int count = 0;
  for (const auto& entry : file.yaml) {
    const CameraKeys keys(entry.second, "");
    if (!keys.Has("projection_type")) continue;
    ++count;
    const bool fits = file.image_width > 0 && keys.NumberOr("width", 0) == file.image_width &&
                      keys.NumberOr("height", 0) == file.image_height;
    if (count > 1 && (!fits || !name.empty())) continue;
    taken.reset(entry.second);
    if (fits) name = entry.first.Scalar();
  }
  const CameraKeys keys(taken, "");
  if (count > 1) {
    result.notes.push_back("of " + std::to_string(count) + " cameras " +
                           (name.empty() ? "the first" : "\"" + name + "\"") + " is taken");
  }
  Camera& camera = result.camera;
  keys.ReadSize("width", "height", &camera);
  if (camera.width <= 0) RefuseCamera("key width is missing");
  const double unit = std::max(camera.width, camera.height);
  const std::string type = keys.Word("projection_type");
  const double focal_x = keys.Number(keys.FirstOf({"focal_x", "focal"}));
  camera.fx = unit * focal_x;
  camera.fy = unit * (keys.Has("focal_y")        ? keys.Number("focal_y")
                      : keys.Has("aspect_ratio") ? focal_x * keys.Number("aspect_ratio")
                                                 : focal_x);
  camera.cx = unit * keys.NumberOr("c_x", 0) + 0.5 * camera.width - 0.5;
  camera.cy = unit * keys.NumberOr("c_y", 0) + 0.5 * camera.height - 0.5;
  const double k1 = keys.NumberOr("k1", 0), k2 = keys.NumberOr("k2", 0), k3 = keys.NumberOr("k3", 0);
  if (type == "perspective" || type == "simple_radial" || type == "radial") {
    camera.distortion[0] = k1;
    camera.distortion[1] = k2;
  } else if (type == "brown") {
    camera.distortion = {k1, k2, keys.NumberOr("p1", 0), keys.NumberOr("p2", 0), k3};
  } else if (type == "fisheye" || type == "fisheye_opencv") {
    camera.model = Camera::Model::kFisheye;
    camera.distortion = {k1, k2, k3, keys.NumberOr("k4", 0)};
  } else {
    RefuseCamera("key projection_type is \"" + type +
                 "\"; known are perspective, simple_radial, radial, brown, fisheye, fisheye_opencv");
  }
  return result;
}

}  // namespace mapmend
