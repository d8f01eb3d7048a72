#include "libs/geometry/camera_formats/camera_format.h"

// SVO and rpg's other programs: a list of cameras (vikit_cameras), and the flat parameters of the first SVO.
// OpenREALM's calib.yaml, which is flat too.
namespace mapmend {
namespace {

std::vector<double> Parameters(const CameraKeys& keys, const std::string& key) {
  return keys.Has(key) ? keys.Numbers(key) : std::vector<double>{};
}

}  // namespace

bool IsSvo(const CameraText& file) {
  if (!CameraKeys(file.yaml, "").Has("cameras")) return false;
  const YAML::Node& root = file.yaml;
  const YAML::Node cameras = root["cameras"];
  return cameras.IsSequence() && cameras.size() > 0 && CameraKeys(cameras[0], "").Has("camera");
}

CameraFile ReadSvo(const CameraText& file) {
  const YAML::Node& root = file.yaml;
  const YAML::Node cameras = root["cameras"];
  CameraFile result;
  size_t taken = 0;
  for (size_t i = cameras.size(); i-- > 0 && file.image_width > 0;) {
    try {  // what is wrong with a camera that is not taken does not matter
      Camera size;
      CameraKeys(cameras[i], "cameras.").Sub("camera").ReadSize("image_width", "image_height", &size);
      if (size.width == file.image_width && size.height == file.image_height) taken = i;
    } catch (const std::exception&) {
    }
  }
  const CameraKeys keys = CameraKeys(cameras[taken], "cameras.").Sub("camera");
  Camera& camera = result.camera;
  const std::string type = keys.Word("type");
  if (type == "pinhole") {
    SetIntrinsics(keys.Numbers("intrinsics", 4), &camera);
    if (keys.Has("distortion")) {
      const CameraKeys distortion = keys.Sub("distortion");
      const std::string name = distortion.Word("type");
      std::vector<double> values = Parameters(distortion, "parameters");
      // rpg calls the model of one angle fisheye.
      SetNamedDistortion(name == "fisheye" && values.size() == 1 ? "fov" : name, values, distortion.Named("type"),
                         distortion.Named("parameters"), &camera);
    }
  } else {
    RefuseCamera(keys.Named("type") + " is \"" + type + "\"; known is pinhole");
  }
  keys.ReadSize("image_width", "image_height", &camera);
  if (cameras.size() > 1) {
    result.notes.push_back("of " + std::to_string(cameras.size()) + " cameras number " + std::to_string(taken + 1) +
                           " is taken");
  }
  return result;
}

bool IsSvoParameters(const CameraText& file) { return CameraKeys(file.yaml, "").Has("cam_model"); }

CameraFile ReadSvoParameters(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  CameraFile result;
  Camera& camera = result.camera;
  const std::string model = keys.Word("cam_model");
  keys.ReadSize("cam_width", "cam_height", &camera);
  keys.ReadIntrinsics("cam_", &camera);
  if (model == "Pinhole") {
    for (int i = 0; i < 4; ++i) camera.distortion[i] = keys.NumberOr("cam_d" + std::to_string(i), 0);
  } else if (model == "ATAN") {
    if (camera.width <= 0) RefuseCamera("key cam_width is missing");
    camera.fx *= camera.width;
    camera.fy *= camera.height;
    camera.cx = camera.cx * camera.width - 0.5;
    camera.cy = camera.cy * camera.height - 0.5;
    SetNamedDistortion("fov", {keys.Number("cam_d0")}, "key cam_model", "key cam_d0", &camera);
  } else {
    RefuseCamera("key cam_model is \"" + model + "\"; known are Pinhole and ATAN");
  }
  return result;
}

bool IsOpenRealm(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  return keys.Has("fx") || (keys.Has("type") && keys.Has("cx"));
}

CameraFile ReadOpenRealm(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  CameraFile result;
  Camera& camera = result.camera;
  const std::string type = keys.Has("type") ? keys.Word("type") : "pinhole";
  if (type != "pinhole") RefuseCamera("key type is \"" + type + "\"; known is pinhole");
  keys.ReadIntrinsics("", &camera);
  const char* names[] = {"k1", "k2", "p1", "p2", "k3"};
  for (int i = 0; i < 5; ++i) camera.distortion[i] = keys.NumberOr(names[i], 0);
  if (keys.NumberOr("k4", 0) != 0) RefuseCamera("key k4 belongs to a fisheye lens, but the type is pinhole");
  keys.ReadSize(keys.FirstOf({"width", "image_width"}), keys.FirstOf({"height", "image_height"}), &camera);
  camera.fps = keys.NumberOr("fps", 0);
  if (camera.fps < 0) RefuseCamera("key fps is negative");
  return result;
}

}  // namespace mapmend
