#include "libs/geometry/camera_formats/camera_format.h"

// Kalibr's camchain, and EuRoC's sensor.yaml, which says the same of one camera.
namespace mapmend {
namespace {

// Intrinsics by camera_model, then the distortion on top of it.
void ReadModel(const CameraKeys& keys, const std::string& coefficients_key, Camera* camera) {
  const std::string model = keys.Word("camera_model");
  const std::string distortion =
      keys.Has("distortion_model") || model == "pinhole" ? keys.Word("distortion_model") : "";
  const bool none = distortion == "none" || distortion.empty();
  const std::string key = keys.Named("distortion_model");
  std::vector<double> coefficients;
  if (!none || keys.Has(coefficients_key)) coefficients = keys.Numbers(coefficients_key);
  if (model == "pinhole") {
    SetIntrinsics(keys.Numbers("intrinsics", 4), camera);
    SetNamedDistortion(distortion, coefficients, key, keys.Named(coefficients_key), camera);
    return;
  }
  if (model == "pinhole-fov" || model == "fov") {
    SetIntrinsics(keys.Numbers("intrinsics", 4), camera);
    SetNamedDistortion("fov", coefficients, key, keys.Named(coefficients_key), camera);
    return;
  }
  if (model != "omni" && model != "ds" && model != "eucm")
    RefuseCamera(keys.Named("camera_model") + " is \"" + model + "\"; known are pinhole, omni, ds, eucm");
  std::vector<double> values;
  Camera plane;  // the distortion of what the sphere shows
  SetNamedDistortion(distortion, coefficients, key, keys.Named(coefficients_key), &plane);
  if (plane.HasDistortion() && (model != "omni" || plane.model != Camera::Model::kPinhole || plane.distortion[4] != 0))
    RefuseCamera(key + " is \"" + distortion + "\" for camera_model \"" + model + "\"; known are " +
                 (model == "omni" ? "radtan and none" : "none"));
  if (model == "omni") {
    values = keys.Numbers("intrinsics", 5);
    camera->model = Camera::Model::kOmni;
    camera->distortion[0] = values[0];
    for (int i = 0; i < 4; ++i) camera->distortion[i + 1] = plane.distortion[i];
    values.erase(values.begin());
  } else {
    values = keys.Numbers("intrinsics", 6);
    camera->model = model == "ds" ? Camera::Model::kDoubleSphere : Camera::Model::kExtendedUnified;
    camera->distortion[0] = values[0];
    camera->distortion[1] = values[1];
    values.erase(values.begin(), values.begin() + 2);
  }
  SetIntrinsics(values, camera);
}

void ReadResolution(const CameraKeys& keys, Camera* camera) {
  const std::vector<double> size = keys.Numbers("resolution", 2);
  for (const double value : size) {
    if (!(value >= 1 && value <= 65535 && value == static_cast<int>(value)))
      RefuseCamera(keys.Named("resolution") + " is not a number of pixels (1 to 65535)");
  }
  camera->width = static_cast<int>(size[0]);
  camera->height = static_cast<int>(size[1]);
}

}  // namespace

bool IsKalibr(const CameraText& file) { return CameraKeys(file.yaml, "").Has("cam0"); }

CameraFile ReadKalibr(const CameraText& file) {
  const CameraKeys root(file.yaml, "");
  CameraFile result;
  int taken = 0, count = 0;
  for (; count < 100 && root.Has("cam" + std::to_string(count)); ++count) {
    if (count == 0 || taken > 0 || file.image_width == 0) continue;
    try {  // the first that fits the images; what is wrong with one that is not taken does not matter
      Camera size;
      ReadResolution(root.Sub("cam" + std::to_string(count)), &size);
      Camera first;
      ReadResolution(root.Sub("cam0"), &first);
      const bool first_fits = first.width == file.image_width && first.height == file.image_height;
      if (!first_fits && size.width == file.image_width && size.height == file.image_height) taken = count;
    } catch (const std::exception&) {
    }
  }
  const std::string name = "cam" + std::to_string(taken);
  const CameraKeys keys = root.Sub(name);
  ReadModel(keys, "distortion_coeffs", &result.camera);
  ReadResolution(keys, &result.camera);
  if (count > 1) result.notes.push_back("of " + std::to_string(count) + " cameras " + name + " is taken");
  return result;
}

bool IsEuroc(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  return keys.Has("sensor_type") || (keys.Has("intrinsics") && keys.Has("camera_model"));
}

CameraFile ReadEuroc(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  if (keys.Has("sensor_type") && keys.Word("sensor_type") != "camera")
    RefuseCamera("key sensor_type is \"" + keys.Word("sensor_type") + "\", not camera");
  CameraFile result;
  ReadModel(keys, keys.FirstOf({"distortion_coefficients", "distortion_coeffs"}), &result.camera);
  ReadResolution(keys, &result.camera);
  result.camera.fps = keys.NumberOr("rate_hz", 0);
  if (result.camera.fps < 0) RefuseCamera("key rate_hz is negative");
  return result;
}

}  // namespace mapmend
