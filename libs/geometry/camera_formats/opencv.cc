#include "libs/geometry/camera_formats/camera_format.h"

// Matrices under many names: OpenCV's calibration programs of all versions, what people write from Python, and ROS
// (camera_calibration's yaml and camera_info messages).
namespace mapmend {
namespace {

const std::vector<std::string> kMatrixKeys = {"camera_matrix",
                                              "Camera_Matrix",
                                              "cameraMatrix",
                                              "CameraMatrix",
                                              "cam_matrix",
                                              "intrinsic_matrix",
                                              "mtx",
                                              "K",
                                              "M1",
                                              "K1"};
const std::vector<std::string> kCoefficientKeys = {"distortion_coefficients",
                                                   "Distortion_Coefficients",
                                                   "distortionCoefficients",
                                                   "DistortionCoefficients",
                                                   "distCoeffs",
                                                   "dist_coeffs",
                                                   "dist_coeff",
                                                   "dist_coefs",
                                                   "distortion",
                                                   "dist",
                                                   "D",
                                                   "D1"};
const std::vector<std::string> kWidthKeys = {"image_width", "image_Width", "imageWidth", "Image_Width", "width"};
const std::vector<std::string> kHeightKeys = {"image_height", "image_Height", "imageHeight", "Image_Height", "height"};

void ReadMatrix(const CameraKeys& keys, const std::string& key, Camera* camera) {
  const std::vector<double> m = keys.Numbers(key);
  if (m.size() != 9) RefuseCamera(keys.Named(key) + ".data needs 9 numbers, it has " + std::to_string(m.size()));
  if (m[1] != 0 || m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1)
    RefuseCamera(keys.Named(key) + ".data is not [fx 0 cx, 0 fy cy, 0 0 1]");
  SetIntrinsics({m[0], m[4], m[2], m[5]}, camera);
}

bool IsTrue(const CameraKeys& keys, const std::string& key) {
  const std::string value = keys.Word(key);
  if (value == "1" || value == "true") return true;
  if (value != "0" && value != "false") RefuseCamera(keys.Named(key) + " is \"" + value + "\"; known are 0 and 1");
  return false;
}

}  // namespace

bool IsOpenCv(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  return keys.Has(keys.FirstOf(kMatrixKeys)) || keys.Has(keys.FirstOf(kCoefficientKeys));
}

CameraFile ReadOpenCv(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  CameraFile result;
  Camera& camera = result.camera;
  ReadMatrix(keys, keys.FirstOf(kMatrixKeys), &camera);
  const std::string coefficients_key = keys.FirstOf(kCoefficientKeys);
  std::string model;
  bool named = false, fisheye = keys.Has("fisheye_model") && IsTrue(keys, "fisheye_model");
  if (keys.Has("distortion_model")) {
    model = keys.Word("distortion_model");
    named = true;
  }
  if (fisheye && named && model != "equidistant" && model != "fisheye")
    RefuseCamera("key distortion_model is \"" + model + "\", but key fisheye_model says fisheye");
  const bool may_lack = named && (model == "none" || model.empty());
  std::vector<double> coefficients;
  if (!may_lack || keys.Has(coefficients_key)) coefficients = keys.Numbers(coefficients_key);
  const std::string where = keys.Named(coefficients_key) + ".data";
  if (named) {
    SetNamedDistortion(model, coefficients, keys.Named("distortion_model"), where, &camera);
  } else if (fisheye) {
    SetFisheyeDistortion(coefficients, where, &camera);
  } else {
    SetOpenCvDistortion(coefficients, where, &camera);
  }
  keys.ReadSize(keys.FirstOf(kWidthKeys), keys.FirstOf(kHeightKeys), &camera);
  return result;
}

bool IsCameraInfo(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  return keys.Has(keys.FirstOf({"K", "k"})) && keys.Has("distortion_model");
}

CameraFile ReadCameraInfo(const CameraText& file) {
  const CameraKeys keys(file.yaml, "");
  CameraFile result;
  ReadMatrix(keys, keys.FirstOf({"K", "k"}), &result.camera);
  for (const char* key : {"binning_x", "binning_y"}) {
    if (keys.NumberOr(key, 0) > 1)
      RefuseCamera(keys.Named(key) + " is more than 1: give the calibration of the binned image");
  }
  if (keys.Has("roi")) {
    const CameraKeys roi = keys.Sub("roi");
    for (const char* key : {"x_offset", "y_offset"}) {
      if (roi.NumberOr(key, 0) != 0)
        RefuseCamera(roi.Named(key) + " is not 0: give the calibration of the part that the images show");
    }
  }
  const std::string coefficients_key = keys.FirstOf({"D", "d"});
  SetNamedDistortion(keys.Word("distortion_model"), keys.Numbers(coefficients_key), keys.Named("distortion_model"),
                     keys.Named(coefficients_key), &result.camera);
  keys.ReadSize("width", "height", &result.camera);
  return result;
}

}  // namespace mapmend
