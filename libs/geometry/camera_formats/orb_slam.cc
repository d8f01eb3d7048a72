#include <algorithm>

#include "libs/geometry/camera_formats/camera_format.h"

// Settings files of ORB-SLAM and of the systems that took its keys over: openvslam and stella_vslam.
namespace mapmend {
namespace {

bool HasFlatKeys(const CameraText& file, const std::string& begin) {
  if (!file.yaml.IsMap()) return false;
  for (const auto& entry : file.yaml) {
    if (entry.first.IsScalar() && entry.first.Scalar().starts_with(begin)) return true;
  }
  return false;
}

// Radial-tangential coefficients under these names; all or none, k3 may be left out: a single one that is missing is
// misspelt. A k4 says that the file is of another lens.
void ReadRadialTangential(const CameraKeys& keys, const std::string& prefix, const std::string& fisheye_hint,
                          Camera* camera) {
  const char* names[] = {"k1", "k2", "p1", "p2", "k3"};
  const bool any = std::any_of(std::begin(names), std::end(names), [&](const char* n) { return keys.Has(prefix + n); });
  if (keys.Has(prefix + "k4") && (!keys.Has(prefix + "p1") || keys.Number(prefix + "k4") != 0)) {
    RefuseCamera(keys.Named(prefix + "k4") +
                 " belongs to a fisheye lens, which the file does not say it is: " + fisheye_hint);
  }
  for (int i = 0; any && i < 4; ++i) camera->distortion[i] = keys.Number(prefix + names[i]);
  camera->distortion[4] = keys.NumberOr(prefix + "k3", 0);
}

void ReadFisheye(const CameraKeys& keys, const std::string& prefix, const std::string& model_key, Camera* camera) {
  camera->model = Camera::Model::kFisheye;
  const char* names[] = {"k1", "k2", "k3", "k4"};
  for (int i = 0; i < 4; ++i) camera->distortion[i] = keys.Number(prefix + names[i]);
  for (const char* name : {"p1", "p2"}) {
    if (keys.NumberOr(prefix + name, 0) == 0) continue;
    RefuseCamera(keys.Named(prefix + name) + " is not zero, but " + model_key +
                 " says fisheye, which has no such coefficient");
  }
}

void ReadFps(const CameraKeys& keys, const std::string& key, Camera* camera) {
  camera->fps = keys.NumberOr(key, 0);
  if (camera->fps < 0) RefuseCamera(keys.Named(key) + " is negative");
}

}  // namespace

bool IsOrbSlam(const CameraText& file) { return HasFlatKeys(file, "Camera.") || HasFlatKeys(file, "Camera1."); }

CameraFile ReadOrbSlam(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  const std::string prefix = keys.Has("Camera1.fx") ? "Camera1." : "Camera.";
  CameraFile result;
  Camera& camera = result.camera;
  bool fisheye = false;
  if (keys.Has("Camera.type")) {
    const std::string type = keys.Word("Camera.type");
    fisheye = type == "KannalaBrandt8";
    if (!fisheye && type != "PinHole" && type != "Pinhole" && type != "Rectified")
      RefuseCamera("key Camera.type is \"" + type + "\"; known are PinHole, Rectified and KannalaBrandt8");
  }
  keys.ReadIntrinsics(prefix, &camera);
  if (fisheye)
    ReadFisheye(keys, prefix, "Camera.type", &camera);
  else
    ReadRadialTangential(keys, prefix, "give Camera.type: \"KannalaBrandt8\" if it is", &camera);
  keys.ReadSize("Camera.width", "Camera.height", &camera);
  ReadFps(keys, "Camera.fps", &camera);
  return result;
}

bool IsStella(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  if (keys.Has("Camera") && file.yaml["Camera"].IsMap()) return true;
  return keys.Has("Camera.model") || keys.Has("Camera.setup") || keys.Has("Camera.cols") || keys.Has("Camera.rows");
}

CameraFile ReadStella(const CameraText& file) {
  const CameraKeys root(file.yaml, "");
  const bool nested = root.Has("Camera");
  const CameraKeys keys = nested ? root.Sub("Camera") : root;
  const std::string prefix = nested ? "" : "Camera.";
  CameraFile result;
  Camera& camera = result.camera;
  const std::string model = keys.Has(prefix + "model") ? keys.Word(prefix + "model") : "perspective";
  if (model == "equirectangular") {
    RefuseCamera(keys.Named(prefix + "model") +
                 " is \"equirectangular\": images of all directions cannot be mapped; cut views out of them first");
  }
  if (model != "perspective" && model != "fisheye" && model != "radial_division") {
    RefuseCamera(keys.Named(prefix + "model") + " is \"" + model +
                 "\"; known are perspective, fisheye and radial_division");
  }
  keys.ReadIntrinsics(prefix, &camera);
  if (model == "fisheye") {
    ReadFisheye(keys, prefix, keys.Named(prefix + "model").substr(4), &camera);
  } else if (model == "radial_division") {
    camera.model = Camera::Model::kDivision;
    camera.distortion[0] = keys.Number(prefix + "distortion");
  } else {
    ReadRadialTangential(keys, prefix, "give \"fisheye\" as its model if it is", &camera);
  }
  keys.ReadSize(prefix + "cols", prefix + "rows", &camera);
  ReadFps(keys, prefix + "fps", &camera);
  return result;
}

}  // namespace mapmend
