#include "libs/geometry/camera_formats/camera_format.h"

// VINS-Mono and VINS-Fusion (camodocal).
namespace mapmend {

bool IsVins(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  return keys.Has("model_type") || keys.Has("projection_parameters");
}

CameraFile ReadVins(const CameraText& file) {
  const CameraKeys root(file.yaml, "");
  CameraFile result;
  Camera& camera = result.camera;
  const std::string type = root.Word("model_type");
  const auto radial_tangential = [&](int at) {
    const CameraKeys keys = root.Sub("distortion_parameters");
    const char* names[] = {"k1", "k2", "p1", "p2"};
    for (int i = 0; i < 4; ++i) camera.distortion[at + i] = keys.Number(names[i]);
    return keys;
  };
  const auto projection = [&](const char* fx, const char* fy, const char* cx, const char* cy) {
    const CameraKeys keys = root.Sub("projection_parameters");
    SetIntrinsics({keys.Number(fx), keys.Number(fy), keys.Number(cx), keys.Number(cy)}, &camera);
    return keys;
  };
  if (type == "PINHOLE") {
    projection("fx", "fy", "cx", "cy");
    radial_tangential(0);
  } else if (type == "PINHOLE_FULL") {
    projection("fx", "fy", "cx", "cy");
    const CameraKeys keys = radial_tangential(0);
    const char* names[] = {"k3", "k4", "k5", "k6"};
    for (int i = 0; i < 4; ++i) camera.distortion[4 + i] = keys.Number(names[i]);
    SetOpenCvDistortion({camera.distortion.begin(), camera.distortion.begin() + 8}, "distortion_parameters", &camera);
  } else if (type == "KANNALA_BRANDT") {
    const CameraKeys keys = projection("mu", "mv", "u0", "v0");
    camera.model = Camera::Model::kFisheye;
    const char* names[] = {"k2", "k3", "k4", "k5"};  // of its own count: the first power is 1
    for (int i = 0; i < 4; ++i) camera.distortion[i] = keys.Number(names[i]);
  } else if (type == "MEI") {
    projection("gamma1", "gamma2", "u0", "v0");
    camera.model = Camera::Model::kOmni;
    camera.distortion[0] = root.Sub("mirror_parameters").Number("xi");
    radial_tangential(1);
  } else {
    RefuseCamera("key model_type is \"" + type + "\"; known are PINHOLE, PINHOLE_FULL, KANNALA_BRANDT, MEI");
  }
  root.ReadSize("image_width", "image_height", &camera);
  return result;
}

}  // namespace mapmend
