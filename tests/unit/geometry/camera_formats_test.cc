#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <random>
#include <stdexcept>

#include "libs/geometry/camera_file.h"
#include "tests/scratch_folder.h"

// One and the same camera in every format that is read, and what each refuses.
namespace mapmend {
namespace camera_formats_test {

using Model = Camera::Model;

std::string CamerasBin(int model, const std::vector<double>& parameters) {
  std::string bytes;
  const auto put = [&](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof(value)); };
  put(uint64_t{1}), put(uint32_t{1}), put(int32_t{model}), put(uint64_t{400}), put(uint64_t{300});
  for (const double p : parameters) put(p);
  return bytes;
}

const std::string kMatrix = "[239.125, 0., 199.5, 0., 239.125, 149.5, 0., 0., 1.]";

std::string OpenCv(const std::string& coefficients, const std::string& more = "") {
  return "%YAML:1.0\n---\nimage_width: 400\nimage_height: 300\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: "
         "3\n" +
         ("   dt: d\n   data: " + kMatrix + "\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n") +
         "   dt: d\n   data: [" + coefficients + "]\n" + more;
}

std::string Euroc(const std::string& distortion) {
  return "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 1\n  data: [1.0, 0.0, 0.0, 0.0]\nrate_hz: 20\n"
         "resolution: [400, 300]\ncamera_model: pinhole\nintrinsics: [239.125, 239.125, 199.5, 149.5] #fu, fv, cu, "
         "cv\n" +
         distortion;
}

std::string Stella(const std::string& more) {
  return "Camera.name: \"phone\"\nCamera.setup: \"monocular\"\nCamera.fx: 239.125\nCamera.fy: 239.125\nCamera.cx: "
         "199.5\n"
         "Camera.cy: 149.5\nCamera.fps: 30.0\nCamera.cols: 400\nCamera.rows: 300\n" +
         more;
}

std::string Kalibr(const std::string& model, const std::string& intrinsics, const std::string& distortion,
                   const std::string& coefficients) {
  return "cam0:\n  camera_model: " + model + "\n  intrinsics: " + intrinsics + "\n  distortion_model: " + distortion +
         "\n  distortion_coeffs: " + coefficients + "\n  resolution: [400, 300]\n";
}

std::string Colmap(const std::string& rest) { return "# list\n#   CAMERA_ID, MODEL\n1 " + rest + "\n"; }

struct Example {
  const char* format;
  std::string text;
  Model model;
  std::vector<double> coefficients;
  double fx = 239.125;  // of the file, before what the model makes of it
};

std::vector<Example> Examples() {
  const std::vector<double> radtan = {-0.012, 0.0154, 0.0001, -0.0002};
  const std::string r = "-0.012, 0.0154, 0.0001, -0.0002";
  const std::string ros =
      "image_width: 400\nimage_height: 300\ncamera_name: belly\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: " +
      kMatrix + "\nprojection_matrix:\n  rows: 3\n  cols: 4\n  data: [238.0, 0, 199, 0, 0, 238, 149, 0, 0, 0, 1, 0]\n";
  const std::string svo =
      "label: belly\ncameras:\n- camera:\n    image_height: 300\n    image_width: 400\n    type: pinhole\n"
      "    intrinsics:\n      cols: 1\n      rows: 4\n      data: [239.125, 239.125, 199.5, 149.5]\n    distortion:\n";
  const std::string vins = "%YAML:1.0\n---\ncamera_name: camera\nimage_width: 400\nimage_height: 300\n";
  const std::string odm = "{\n\t\"v2 acme\": {\"width\": 400, \"height\": 300, ";
  return {
      {"Kalibr", Kalibr("pinhole", "[239.125, 239.125, 199.5, 149.5]", "radtan", "[" + r + "]"), Model::kPinhole,
       radtan},
      {"Kalibr",
       Kalibr("pinhole", "[239.125, 239.125, 199.5, 149.5]", "equidistant", "[0.1, 0.2, 0.3, 0.4]"),
       Model::kFisheye,
       {0.1, 0.2, 0.3, 0.4}},
      {"Kalibr", Kalibr("pinhole", "[239.125, 239.125, 199.5, 149.5]", "fov", "[0.9]"), Model::kFov, {0.9}},
      {"Kalibr", Kalibr("pinhole", "[239.125, 239.125, 199.5, 149.5]", "none", "[]"), Model::kPinhole, {}},
      {"Kalibr",
       Kalibr("omni", "[1.7, 650, 650, 199.5, 149.5]", "radtan", "[" + r + "]"),
       Model::kOmni,
       {1.7, -0.012, 0.0154, 0.0001, -0.0002},
       650},
      {"Kalibr", Kalibr("omni", "[1.7, 650, 650, 199.5, 149.5]", "none", "[]"), Model::kOmni, {1.7}, 650},
      {"Kalibr",
       Kalibr("ds", "[-0.2, 0.6, 180, 180, 199.5, 149.5]", "none", "[]"),
       Model::kDoubleSphere,
       {-0.2, 0.6},
       180},
      {"Kalibr",
       Kalibr("eucm", "[0.6, 1.1, 180, 180, 199.5, 149.5]", "none", "[]"),
       Model::kExtendedUnified,
       {0.6, 1.1},
       180},
      {"EuRoC", Euroc("distortion_model: radial-tangential\ndistortion_coefficients: [" + r + "]\n"), Model::kPinhole,
       radtan},
      {"EuRoC",
       Euroc("distortion_model: equidistant\ndistortion_coefficients: [0.1, 0.2, 0.3, 0.4]\n"),
       Model::kFisheye,
       {0.1, 0.2, 0.3, 0.4}},
      {"SVO",
       svo + "      type: radial-tangential\n      parameters:\n        cols: 1\n        rows: 4\n        data: [" + r +
           "]\n",
       Model::kPinhole, radtan},
      {"SVO", svo + "      type: none\n", Model::kPinhole, {}},
      {"SVO", svo + "      type: fisheye\n      parameters: {cols: 1, rows: 1, data: [0.9]}\n", Model::kFov, {0.9}},
      {"SVO parameters",
       "cam_model: Pinhole\ncam_width: 400\ncam_height: 300\ncam_fx: 239.125\ncam_fy: 239.125\ncam_cx: 199.5\n"
       "cam_cy: 149.5\ncam_d0: -0.012\ncam_d1: 0.0154\ncam_d2: 0.0001\ncam_d3: -0.0002\n",
       Model::kPinhole, radtan},
      {"SVO parameters",
       "cam_model: ATAN\ncam_width: 400\ncam_height: 300\ncam_fx: 0.5978125\ncam_fy: 0.79708333333\ncam_cx: 0.5\n"
       "cam_cy: 0.5\ncam_d0: 0.93\n",
       Model::kFov,
       {0.93}},
      {"VINS",
       vins +
           "model_type: PINHOLE\ndistortion_parameters:\n   k1: -0.012\n   k2: 0.0154\n   p1: 0.0001\n   p2: -0.0002\n"
           "projection_parameters:\n   fx: 239.125\n   fy: 239.125\n   cx: 199.5\n   cy: 149.5\n",
       Model::kPinhole, radtan},
      {"VINS",
       vins + "model_type: KANNALA_BRANDT\nprojection_parameters:\n   k2: 0.1\n   k3: 0.2\n   k4: 0.3\n   k5: 0.4\n"
              "   mu: 239.125\n   mv: 239.125\n   u0: 199.5\n   v0: 149.5\n",
       Model::kFisheye,
       {0.1, 0.2, 0.3, 0.4}},
      {"VINS",
       vins + "model_type: MEI\nmirror_parameters:\n   xi: 1.7\ndistortion_parameters:\n   k1: -0.012\n   k2: 0.0154\n"
              "   p1: 0.0001\n   p2: -0.0002\nprojection_parameters:\n   gamma1: 650\n   gamma2: 650\n   u0: 199.5\n   "
              "v0: 149.5\n",
       Model::kOmni,
       {1.7, -0.012, 0.0154, 0.0001, -0.0002},
       650},
      {"openvslam",
       Stella("Camera.model: \"perspective\"\nCamera.k1: -0.012\nCamera.k2: 0.0154\nCamera.p1: 0.0001\nCamera.p2: "
              "-0.0002\nCamera.k3: 0.0\n"),
       Model::kPinhole, radtan},
      {"openvslam",
       Stella("Camera.model: \"fisheye\"\nCamera.k1: 0.1\nCamera.k2: 0.2\nCamera.k3: 0.3\nCamera.k4: 0.4\n"),
       Model::kFisheye,
       {0.1, 0.2, 0.3, 0.4}},
      {"openvslam",
       Stella("Camera.model: \"fisheye\"\nCamera.k1: 0.1\nCamera.k2: 0.2\nCamera.p1: 0.0\nCamera.p2: 0\nCamera.k3: "
              "0.3\nCamera.k4: 0.4\n"),
       Model::kFisheye,
       {0.1, 0.2, 0.3, 0.4}},
      {"openvslam", Stella("Camera.model: \"radial_division\"\nCamera.distortion: -0.2\n"), Model::kDivision, {-0.2}},
      {"stella_vslam",
       "Camera:\n  name: \"belly\"\n  setup: \"monocular\"\n  model: \"perspective\"\n  fx: 239.125\n  fy: 239.125\n"
       "  cx: 199.5\n  cy: 149.5\n  k1: -0.012\n  k2: 0.0154\n  p1: 0.0001\n  p2: -0.0002\n  k3: 0.0\n  fps: 30.0\n"
       "  cols: 400\n  rows: 300\nFeature:\n  name: \"default\"\n",
       Model::kPinhole, radtan},
      {"ORB-SLAM",
       "%YAML:1.0\n\nCamera.type: \"PinHole\"\nCamera1.fx: 239.125\nCamera1.fy: 239.125\nCamera1.cx: 199.5\n"
       "Camera1.cy: 149.5\nCamera1.k1: -0.012\nCamera1.k2: 0.0154\nCamera1.p1: 0.0001\nCamera1.p2: -0.0002\n"
       "Camera.width: 400\nCamera.height: 300\n",
       Model::kPinhole, radtan},
      {"ROS camera_info",
       "header:\n  seq: 10\nheight: 300\nwidth: 400\ndistortion_model: plumb_bob\nD: [" + r + ", 0.0]\nK: " + kMatrix +
           "\nR: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nbinning_x: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n---\nheader:\n  seq: "
           "11\n",
       Model::kPinhole, radtan},
      {"ROS camera_info",
       "height: 300\nwidth: 400\ndistortion_model: ''\nd: []\nk:\n- 239.125\n- 0.0\n- 199.5\n- 0.0\n- 239.125\n- "
       "149.5\n- 0.0\n- 0.0\n- 1.0\n",
       Model::kPinhole,
       {}},
      {"OpenCV",
       ros + "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [" + r + ", 0]\n",
       Model::kPinhole, radtan},
      {"OpenCV",
       ros + "distortion_model: rational_polynomial\ndistortion_coefficients:\n  rows: 1\n  cols: 8\n  data: [" + r +
           ", 0.0012, 0.0031, 0.0009, 0.0002]\n",
       Model::kRational,
       {-0.012, 0.0154, 0.0001, -0.0002, 0.0012, 0.0031, 0.0009, 0.0002}},
      {"OpenCV",
       ros + "distortion_model: rational_polynomial\ndistortion_coefficients:\n  data: [" + r + ", 0.0012, 0, 0, 0]\n",
       Model::kPinhole,
       {-0.012, 0.0154, 0.0001, -0.0002, 0.0012}},
      {"OpenCV",
       ros + "distortion_model: none\ndistortion_coefficients:\n  data: [0, 0, 0, 0, 0]\n",
       Model::kPinhole,
       {}},
      {"OpenCV", ros + "distortion_model: none\n", Model::kPinhole, {}},
      {"OpenCV", OpenCv(r + ", 0.003"), Model::kPinhole, {-0.012, 0.0154, 0.0001, -0.0002, 0.003}},
      {"OpenCV",
       OpenCv(r + ", 0.003, 0, 0, 0, 1e-3, 2e-4, 1e-4, 1e-5"),
       Model::kRational,
       {-0.012, 0.0154, 0.0001, -0.0002, 0.003, 0, 0, 0, 1e-3, 2e-4, 1e-4, 1e-5}},
      {"OpenCV",
       OpenCv(r + ", 0.003, 0, 0, 0, 0, 0, 0, 0, 1e-2, 2e-2"),
       Model::kRational,
       {-0.012, 0.0154, 0.0001, -0.0002, 0.003, 0, 0, 0, 0, 0, 0, 0, 1e-2, 2e-2}},
      {"OpenCV", OpenCv("0.1, 0.2, 0.3, 0.4", "fisheye_model: 1\n"), Model::kFisheye, {0.1, 0.2, 0.3, 0.4}},
      {"OpenCV",
       "%YAML:1.0\nimage_Width: 400\nimage_Height: 300\nCamera_Matrix: !!opencv-matrix\n   data: " + kMatrix +
           "\nDistortion_Coefficients: !!opencv-matrix\n   data: [ " + r + ", 0. ]\n",
       Model::kPinhole, radtan},
      {"OpenCV",
       "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>400</image_width>\n<image_height>300</image_height>\n"
       "<camera_matrix type_id=\"opencv-matrix\"><rows>3</rows><cols>3</cols><dt>d</dt>\n<data>239.125 0. 199.5 0. "
       "239.125 149.5 "
       "0. 0. 1.</data></camera_matrix>\n<distortion_coefficients "
       "type_id=\"opencv-matrix\"><rows>5</rows><cols>1</cols>\n"
       "<dt>d</dt><data>-0.012 0.0154 0.0001 -0.0002 0.</data></distortion_coefficients>\n</opencv_storage>\n",
       Model::kPinhole, radtan},
      {"OpenCV",
       "camera_matrix:\n- [239.125, 0.0, 199.5]\n- [0.0, 239.125, 149.5]\n- [0.0, 0.0, 1.0]\ndist_coeff:\n- [" + r +
           ", 0.0]\nwidth: 400\nheight: 300\n",
       Model::kPinhole, radtan},
      {"OpenREALM",
       "type: pinhole\nfps: 5\nwidth: 400\nheight: 300\ncx: 199.5\ncy: 149.5\nfx: 239.125\nfy: 239.125\n"
       "k1: -0.012\nk2: 0.0154\np1: 0.0001\np2: -0.0002\nk3: 0.0\n",
       Model::kPinhole, radtan},
      {"ODM",
       odm + "\"projection_type\": \"brown\", \"focal_x\": 0.5978125, \"focal_y\": 0.5978125, \"c_x\": 0.0, \"c_y\": "
             "0.0, "
             "\"k1\": -0.012, \"k2\": 0.0154, \"p1\": 0.0001, \"p2\": -0.0002, \"k3\": 0.0}}\n",
       Model::kPinhole, radtan},
      {"ODM",
       odm + "\"projection_type\": \"perspective\", \"focal\": 0.5978125, \"k1\": 0.1, \"k2\": 0.2}}",
       Model::kPinhole,
       {0.1, 0.2}},
      {"ODM",
       odm + "\"projection_type\": \"fisheye_opencv\", \"focal_x\": 0.5978125, \"focal_y\": 0.5978125, \"c_x\": 0, "
             "\"c_y\": 0, "
             "\"k1\": 0.1, \"k2\": 0.2, \"k3\": 0.3, \"k4\": 0.4}}",
       Model::kFisheye,
       {0.1, 0.2, 0.3, 0.4}},
      {"cameras.txt", Colmap("SIMPLE_PINHOLE 400 300 239.125 200 150"), Model::kPinhole, {}},
      {"cameras.txt", Colmap("PINHOLE 400 300 239.125 239.125 200 150"), Model::kPinhole, {}},
      {"cameras.txt", Colmap("SIMPLE_RADIAL 400 300 239.125 200 150 0.1"), Model::kPinhole, {0.1}},
      {"cameras.txt", Colmap("RADIAL 400 300 239.125 200 150 0.1 0.2"), Model::kPinhole, {0.1, 0.2}},
      {"cameras.txt", Colmap("OPENCV 400 300 239.125 239.125 200 150 -0.012 0.0154 0.0001 -0.0002"), Model::kPinhole,
       radtan},
      {"cameras.txt",
       Colmap("OPENCV_FISHEYE 400 300 239.125 239.125 200 150 0.1 0.2 0.3 0.4"),
       Model::kFisheye,
       {0.1, 0.2, 0.3, 0.4}},
      {"cameras.txt",
       Colmap("FULL_OPENCV 400 300 239.125 239.125 200 150 -0.012 0.0154 0.0001 -0.0002 0.003 0.02 0.001 0.0004"),
       Model::kRational,
       {-0.012, 0.0154, 0.0001, -0.0002, 0.003, 0.02, 0.001, 0.0004}},
      {"cameras.txt",
       Colmap("FULL_OPENCV 400 300 239.125 239.125 200 150 -0.012 0.0154 0.0001 -0.0002 0.003 0 0 0"),
       Model::kPinhole,
       {-0.012, 0.0154, 0.0001, -0.0002, 0.003}},
      {"cameras.txt", Colmap("FOV 400 300 239.125 239.125 200 150 0.9"), Model::kFov, {0.9}},
      {"cameras.txt", Colmap("SIMPLE_RADIAL_FISHEYE 400 300 239.125 200 150 0.1"), Model::kFisheye, {0.1}},
      {"cameras.txt", Colmap("RADIAL_FISHEYE 400 300 239.125 200 150 0.1 0.2"), Model::kFisheye, {0.1, 0.2}},
      {"cameras.txt",
       Colmap("THIN_PRISM_FISHEYE 400 300 239.125 239.125 200 150 0.003 0.0007 1e-4 2e-4 0.1 0.2 1e-3 2e-3"),
       Model::kThinPrismFisheye,
       {0.003, 0.0007, 1e-4, 2e-4, 0.1, 0.2, 1e-3, 2e-3}},
      {"cameras.bin", CamerasBin(2, {239.125, 200, 150, -0.012}), Model::kPinhole, {-0.012}},
      {"cameras.bin",
       CamerasBin(5, {239.125, 239.125, 200, 150, 0.1, 0.2, 0.3, 0.4}),
       Model::kFisheye,
       {0.1, 0.2, 0.3, 0.4}},
      {"DSO", "0.5978125 0.79708333333 0.5 0.5 0.93\n400 300\ncrop\n400 300\n", Model::kFov, {0.93}},
      {"DSO", "0.5978125 0.79708333333 0.5 0.5 0\n400 300\nnone\n400 300\n", Model::kPinhole, {}},
      {"DSO", "FOV 239.125 239.125 199.5 149.5 0.93\n400 300\ncrop\n400 300\n", Model::kFov, {0.93}},
      {"DSO", "Pinhole 239.125 239.125 199.5 149.5 0\n400 300\ncrop\n400 300\n", Model::kPinhole, {}},
      {"DSO", "RadTan 239.125 239.125 199.5 149.5 -0.012 0.0154 0.0001 -0.0002\n400 300\ncrop\n400 300\n",
       Model::kPinhole, radtan},
      {"DSO", "239.125 239.125 199.5 149.5 -0.012 0.0154 0.0001 -0.0002\r\n400 300\r\nfull\r\n400 300\r\n",
       Model::kPinhole, radtan},
      {"DSO",
       "EquiDistant 0.5978125 0.79708333333 0.5 0.5 0.1 0.2 0.3 0.4\n400 300\ncrop\n400 300\n",
       Model::kFisheye,
       {0.1, 0.2, 0.3, 0.4}},
  };
}

class CameraFormatsTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& content) {
    std::ofstream(folder_.File("camera"), std::ios::binary) << content;
    return folder_.File("camera");
  }
  std::string ErrorOf(const std::string& content, int width = 0, int height = 0) {
    try {
      Write(content);
      if (width > 0)
        ReadCameraFor(folder_.File("camera"), width, height);
      else
        ReadCameraFile(folder_.File("camera"));
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  }
  void ExpectError(const std::string& content, const std::string& part) {
    const std::string error = ErrorOf(content);
    EXPECT_NE(error.find(part), std::string::npos) << "\"" << error << "\" from\n" << content;
    EXPECT_EQ(error.find('\n'), std::string::npos);
  }
  ScratchFolder folder_;
};

TEST_F(CameraFormatsTest, EachIsReadAsWhatItIs) {
  for (const Example& example : Examples()) {
    SCOPED_TRACE(example.text);
    CameraFile file;
    ASSERT_NO_THROW(file = ReadCameraFile(Write(example.text)));
    EXPECT_NE(file.format.find(example.format), std::string::npos) << file.format;
    EXPECT_EQ(static_cast<int>(file.camera.model), static_cast<int>(example.model)) << file.camera.ModelName();
    EXPECT_EQ(file.camera.width, 400);
    EXPECT_EQ(file.camera.height, 300);
    EXPECT_NEAR(file.camera.fx, example.fx, 1e-6);
    EXPECT_NEAR(file.camera.fy, example.fx, 1e-6);
    EXPECT_NEAR(file.camera.cx, 199.5, 1e-9);
    EXPECT_NEAR(file.camera.cy, 149.5, 1e-9);
    for (size_t i = 0; i < file.camera.distortion.size(); ++i)
      EXPECT_EQ(file.camera.distortion[i], i < example.coefficients.size() ? example.coefficients[i] : 0) << i;
    EXPECT_TRUE(file.notes.empty());
  }
}

// As Windows writes it, and as an editor with a byte order mark does.
TEST_F(CameraFormatsTest, LineEndsAndByteOrderMarksDoNotMatter) {
  for (const Example& example : Examples()) {
    if (example.text.find('\0') != std::string::npos) continue;
    std::string text = "\xEF\xBB\xBF";
    for (const char c : example.text) text += c == '\n' ? std::string("\r\n") : std::string(1, c);
    const CameraFile expected = ReadCameraFile(Write(example.text));
    CameraFile file;
    ASSERT_NO_THROW(file = ReadCameraFile(Write(text))) << example.text;
    EXPECT_EQ(file.camera.distortion, expected.camera.distortion) << example.text;
    EXPECT_EQ(file.format, expected.format);
  }
}

TEST_F(CameraFormatsTest, WhatContradictsItselfIsRefused) {
  ExpectError("Camera.fx: 1\nCamera.width: 640\nCamera.width: 400\n", "key Camera.width is there twice");
  ExpectError(Stella("Camera.model: \"equirectangular\"\n"), "equirectangular");
  ExpectError(Stella("Camera.model: \"fisheye\"\nCamera.k1: 0.1\nCamera.k2: 0.2\nCamera.p1: 0.1\nCamera.k3: "
                     "0.3\nCamera.k4: 0.4\n"),
              "Camera.p1 is not zero, but Camera.model says fisheye");
  ExpectError(Stella("Camera.k1: 0.1\nCamera.k2: 0.2\nCamera.k3: 0.3\nCamera.k4: 0.4\n"),
              "Camera.k4 belongs to a fisheye");
  ExpectError(
      "Camera.fx: 239\nCamera.fy: 239\nCamera.cx: 199\nCamera.cy: 149\nCamera.k1: 0.1\nCamera.k2: 0.2\nCamera.k3: "
      "0.3\nCamera.k4: 0.4\n",
      "KannalaBrandt8");
  ExpectError(OpenCv("0.1, 0.2, 0, 0, 0", "distortion_model: none\n"),
              "distortion_model is \"none\", but there are coefficients");
  ExpectError(OpenCv("0.1, 0.2, 0, 0, 0.3", "fisheye_model: 1\n"), "needs 4 numbers for a fisheye");
  ExpectError(OpenCv("0.1, 0.2, 0, 0", "fisheye_model: 1\ndistortion_model: plumb_bob\n"), "says fisheye");
  ExpectError(Kalibr("ds", "[-0.2, 0.6, 180, 180, 199.5, 149.5]", "radtan", "[0.1, 0, 0, 0]"),
              "cam0.distortion_model is \"radtan\"");
}

TEST_F(CameraFormatsTest, WhatIsNotReadIsRefusedByItsName) {
  ExpectError(Kalibr("pinhole", "[1, 1, 1, 1]", "equidistant", "[0.1]"), "key cam0.distortion_coeffs needs 4");
  ExpectError(Euroc("distortion_model: radial-tangential\n"),
              "key distortion_coefficients is missing (EuRoC sensor.yaml)");
  ExpectError("Camera:\n  fx: 1\n  fy: 1\n  cx: 1\n", "key Camera.cy is missing (openvslam or stella_vslam settings)");
  ExpectError("%YAML:1.0\nmodel_type: SCARAMUZZA\n", "SCARAMUZZA");
  ExpectError("{\"a\": {\"projection_type\": \"spherical\", \"width\": 4, \"height\": 3, \"focal\": 0.5}}",
              "\"spherical\"");
  ExpectError("RadTan 1 2 3\n400 300\n", "RadTan needs 8 numbers, it has 3 (DSO camera.txt)");
  ExpectError("Pinhole 300 300 200 150 0\n", "line 2, width and height, is missing");
  ExpectError("1 RAD_TAN_THIN_PRISM_FISHEYE 400 300 1\n", "camera model RAD_TAN_THIN_PRISM_FISHEYE is not known");
  ExpectError(CamerasBin(2, {239.125, 200}), "is cut short (COLMAP cameras.bin)");
  ExpectError(CamerasBin(40, {239.125, 200}), "camera model number 40");
  ExpectError("<?xml version=\"1.0\"?>\n<calibration><f>1</f></calibration>", "Metashape");
  ExpectError("value0: {intrinsics: []}\n", "Basalt");
  ExpectError("height: 300\nwidth: 400\ndistortion_model: plumb_bob\nD: [0,0,0,0,0]\nbinning_x: 2\nK: " + kMatrix,
              "binning_x");
  ExpectError("Camera.fx: 0.6\nCamera.fy: 0.8\nCamera.cx: 0.5\nCamera.cy: 0.5\n", "the intrinsics are normalised");
}

TEST_F(CameraFormatsTest, OfSeveralCamerasTheOneThatFitsIsTaken) {
  const std::string text =
      "3 SIMPLE_RADIAL 640 480 520 320 240 -0.05\n1 SIMPLE_RADIAL 400 300 239.125 200 150 -0.012\n";
  CameraFile file = ReadCameraFile(Write(text));
  EXPECT_EQ(file.camera.width, 640);
  ASSERT_EQ(file.notes.size(), 1u);
  EXPECT_NE(file.notes[0].find("of 2 cameras the one with id 3 is taken"), std::string::npos) << file.notes[0];
  file = ReadCameraFor(Write(text), 400, 300);
  EXPECT_EQ(file.camera.fx, 239.125);
  EXPECT_NE(file.notes.at(0).find("id 1 is taken"), std::string::npos) << file.notes[0];
  const std::string kalibr = Kalibr("pinhole", "[100, 100, 50, 50]", "none", "[]");
  std::string second = kalibr;
  second.replace(0, 5, "cam1:");
  second.replace(second.find("400, 300"), 8, "100, 100");
  EXPECT_EQ(ReadCameraFor(Write(kalibr + second), 100, 100).camera.width, 100);
  EXPECT_NE(ReadCameraFile(Write(kalibr + second)).notes.at(0).find("cam0 is taken"), std::string::npos);
}

std::string NoSize(double f, double cx, double cy) {
  char text[200];
  std::snprintf(text, sizeof(text), "Camera.fx: %g\nCamera.fy: %g\nCamera.cx: %g\nCamera.cy: %g\n", f, f, cx, cy);
  return text;
}

TEST_F(CameraFormatsTest, AFileMustMeanTheseImages) {
  EXPECT_EQ(ErrorOf(NoSize(239, 199, 149), 400, 300), "");
  EXPECT_EQ(ErrorOf(NoSize(3000, 199, 149), 400, 300), "");  // a long lens
  EXPECT_NE(ErrorOf(NoSize(2391.25, 1999.5, 1499.5), 200, 150).find("principal point"), std::string::npos);
  EXPECT_NE(ErrorOf(NoSize(20, 199, 149), 400, 300).find("focal length"), std::string::npos);
  EXPECT_NE(ErrorOf(NoSize(9000, 199, 149), 400, 300).find("add width and height"), std::string::npos);
  EXPECT_EQ(ErrorOf(NoSize(9000, 199, 149) + "Camera.width: 400\nCamera.height: 300\n", 400, 300), "");
  const std::string large = NoSize(2391.25, 1999.5, 1499.5) + "Camera.width: 4000\nCamera.height: 3000\n";
  EXPECT_NE(ErrorOf(large, 1920, 1080).find("of another shape"), std::string::npos);
  EXPECT_NE(ErrorOf(large, 1080, 1440).find("turned by 90 degrees"), std::string::npos);
  // The numbers of a small camera with a wrong size are not scaled.
  EXPECT_NE(ErrorOf(NoSize(119.56, 99.5, 74.5) + "Camera.width: 640\nCamera.height: 480\n", 200, 150)
                .find("are width and height right?"),
            std::string::npos);
  const CameraFile scaled = ReadCameraFor(Write(large), 400, 300);
  EXPECT_NEAR(scaled.camera.fx, 239.125, 1e-9);
  EXPECT_NEAR(scaled.camera.cx, 199.5, 1e-9);
  EXPECT_EQ(scaled.camera.width, 400);
  EXPECT_NE(scaled.notes.at(0).find("the calibration is scaled"), std::string::npos);
}

TEST_F(CameraFormatsTest, ALensWithoutInverseIsTold) {
  const auto text = [](double k1) { return Colmap("SIMPLE_RADIAL 400 300 239.125 200 150 " + std::to_string(k1)); };
  EXPECT_TRUE(ReadCameraFor(Write(text(-0.1)), 400, 300).notes.empty());
  EXPECT_NE(ReadCameraFor(Write(text(-0.2)), 400, 300).notes.at(0).find("has no inverse on"), std::string::npos);
  EXPECT_NE(ErrorOf(text(-1.5), 400, 300).find("right sign"), std::string::npos);
  EXPECT_NEAR(ShareWithoutInverse(ReadCamera(Write(text(-0.1)))), 0, 1e-12);
}

// Bytes changed, left out, doubled: each is read or refused in one line, in bounded time.
TEST_F(CameraFormatsTest, DamagedFilesAreReadOrRefused) {
  std::mt19937 random(1);
  int num_read = 0, num_refused = 0;
  for (const Example& example : Examples()) {
    for (int i = 0; i < 100; ++i) {
      std::string text = example.text;
      const int num_changes = 1 + static_cast<int>(random() % 3);
      for (int k = 0; k < num_changes && !text.empty(); ++k) {
        const size_t at = random() % text.size();
        switch (random() % 5) {
          case 0:
            text[at] = static_cast<char>(random());
            break;
          case 1:
            text.erase(at, 1 + random() % 8);
            break;
          case 2:
            text.insert(at, text.substr(random() % text.size(), random() % 40));
            break;
          case 3:
            text[at] = "0123456789.-e:[]{}\n #,&*"[random() % 24];
            break;
          default:
            if (random() % 10 == 0) text.resize(at);
            break;
        }
      }
      const std::string error = ErrorOf(text, 400, 300);
      ASSERT_EQ(error.find('\n'), std::string::npos) << error;
      ++(error.empty() ? num_read : num_refused);
    }
  }
  EXPECT_GT(num_read, 1000);
  EXPECT_GT(num_refused, 1000);
}

TEST(FormatCameraFile, IsReadBackToTheLastDigit) {
  const ScratchFolder folder;
  Camera camera;
  camera.width = 800;
  camera.height = 600;
  camera.fx = 478.25000123;
  camera.fy = 479.5;
  camera.cx = 399.25;
  camera.cy = 301;
  camera.fps = 29.97;
  for (const Model model : {Model::kPinhole, Model::kFisheye}) {
    camera.model = model;
    camera.distortion = {-0.0123456789, 0.02, 0.0003, -0.00004, model == Model::kPinhole ? 0.005 : 0};
    std::ofstream(folder.File("camera.yaml")) << FormatCameraFile(camera, {"made by a test", "of two lines"});
    const Camera read = ReadCamera(folder.File("camera.yaml"));
    EXPECT_EQ(read.model, camera.model);
    EXPECT_EQ(read.fx, camera.fx);
    EXPECT_EQ(read.fy, camera.fy);
    EXPECT_EQ(read.cx, camera.cx);
    EXPECT_EQ(read.cy, camera.cy);
    EXPECT_EQ(read.distortion, camera.distortion);
    EXPECT_EQ(read.width, 800);
    EXPECT_EQ(read.height, 600);
    EXPECT_EQ(read.fps, 29.97);
  }
  camera.model = Model::kFov;
  EXPECT_THROW(FormatCameraFile(camera, {}), std::runtime_error);
}

}  // namespace camera_formats_test
}  // namespace mapmend
