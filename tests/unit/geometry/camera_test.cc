#include "libs/geometry/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <utility>
#include <vector>

namespace mapmend {
namespace camera_test {

class ReadCameraTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("mapmend_camera_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& text) {
    const std::string path = (folder_ / name).string();
    std::ofstream(path) << text;
    return path;
  }
  static std::string ErrorOf(const std::string& path) {
    try {
      ReadCamera(path);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  }

  std::filesystem::path folder_;
};

TEST_F(ReadCameraTest, OrbSlamYaml) {
  const Camera c = ReadCamera(std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/camera.yaml");
  EXPECT_DOUBLE_EQ(c.fx, 478.25);
  EXPECT_DOUBLE_EQ(c.cy, 299.5);
  EXPECT_DOUBLE_EQ(c.distortion[0], -0.01198);
  EXPECT_DOUBLE_EQ(c.distortion[1], 0.01538);
  EXPECT_EQ(c.width, 800);
  EXPECT_EQ(c.model, Camera::Model::kPinhole);
}

TEST_F(ReadCameraTest, KalibrCamchain) {
  const Camera c = ReadCamera(Write("k.yaml",
                                    "cam0:\n  camera_model: pinhole\n  distortion_model: equidistant\n"
                                    "  distortion_coeffs: [0.1, 0.2, 0.3, 0.4]\n  intrinsics: [400, 401, 320, 240]\n"
                                    "  resolution: [640, 480]\n"));
  EXPECT_EQ(c.model, Camera::Model::kFisheye);
  EXPECT_EQ(c.fy, 401);
  EXPECT_EQ(c.distortion[3], 0.4);
  EXPECT_EQ(c.height, 480);
}

TEST_F(ReadCameraTest, OpenCvCalibration) {
  const Camera c =
      ReadCamera(Write("o.yaml",
                       "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n"
                       "   rows: 3\n   cols: 3\n   dt: d\n   data: [ 500., 0., 320., 0., 510., 240., 0., 0., 1. ]\n"
                       "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
                       "   data: [ 0.1, -0.2, 0.001, 0.002, 0.05 ]\n"));
  EXPECT_EQ(c.fy, 510);
  EXPECT_EQ(c.distortion[4], 0.05);
}

TEST_F(ReadCameraTest, ColmapPixelCentresAreHalfAPixelOff) {
  const Camera c =
      ReadCamera(Write("cameras.txt", "# comment\n1 OPENCV 640 480 500 510 320.5 240.5 0.1 0.2 0.3 0.4\n"));
  EXPECT_EQ(c.cx, 320);
  EXPECT_EQ(c.cy, 240);
  EXPECT_EQ(c.distortion[3], 0.4);
}

TEST_F(ReadCameraTest, ErrorsNameTheFileAndTheKey) {
  EXPECT_NE(ErrorOf("/no/such/camera.yaml").find("/no/such/camera.yaml"), std::string::npos);
  EXPECT_NE(ErrorOf(Write("a.yaml", "Camera.fx: 500\nCamera.fy: 500\nCamera.cx: 320\n")).find("Camera.cy is missing"),
            std::string::npos);
  EXPECT_NE(ErrorOf(Write("b.yaml", "Camera.fx: much\nCamera.fy: 500\nCamera.cx: 1\nCamera.cy: 1\n"))
                .find("Camera.fx is not a number"),
            std::string::npos);
  EXPECT_NE(ErrorOf(Write("c.yaml", "Camera.fx: -5\nCamera.fy: 500\nCamera.cx: 1\nCamera.cy: 1\n")).find("positive"),
            std::string::npos);
  EXPECT_NE(ErrorOf(Write("cameras.txt", "1 FULL_OPENCV 640 480 1\n")).find("FULL_OPENCV"), std::string::npos);
}

// Each key of each format in turn: left out, or not what it should be. The message names it.
struct CameraFormat {
  const char* file;
  std::vector<std::pair<std::string, std::string>> keys;  // as the file and as the message names them
};

std::string ReadAll(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

// The text without the line that begins with the key, or with another value in it.
std::string WithKey(const std::string& text, const std::string& key, const char* value) {
  std::istringstream lines(text);
  std::string result;
  for (std::string line; std::getline(lines, line);) {
    const size_t begin = line.find_first_not_of(' ');
    if (begin != std::string::npos && line.compare(begin, key.size() + 1, key + ":") == 0) {
      if (value == nullptr) continue;
      line = line.substr(0, begin) + key + ": " + value;
    }
    result += line + "\n";
  }
  return result;
}

TEST_F(ReadCameraTest, EachMissingOrWrongKeyIsNamed) {
  const CameraFormat formats[] = {
      {"orb_slam.yaml",
       {{"Camera.fx", ""},
        {"Camera.fy", ""},
        {"Camera.cx", ""},
        {"Camera.cy", ""},
        {"Camera.k1", ""},
        {"Camera.k2", ""},
        {"Camera.p1", ""},
        {"Camera.p2", ""},
        {"Camera.width", ""},
        {"Camera.height", ""}}},
      {"orb_slam_fisheye.yaml",
       {{"Camera.fx", ""},
        {"Camera.cy", ""},
        {"Camera.k1", ""},
        {"Camera.k2", ""},
        {"Camera.k3", ""},
        {"Camera.k4", ""}}},
      {"kalibr.yaml",
       {{"camera_model", "cam0."},
        {"intrinsics", "cam0."},
        {"distortion_model", "cam0."},
        {"distortion_coeffs", "cam0."},
        {"resolution", "cam0."}}},
      {"opencv.yaml",
       {{"image_width", ""}, {"image_height", ""}, {"camera_matrix", ""}, {"distortion_coefficients", ""}}},
  };
  for (const CameraFormat& format : formats) {
    const std::string text = ReadAll(std::string(MAPMEND_SOURCE_DIR) + "/data/cameras/" + format.file);
    ASSERT_EQ(ErrorOf(Write("good.yaml", text)), "") << format.file;
    for (const auto& [key, prefix] : format.keys) {
      // The data of an OpenCV matrix stand in lines of their own.
      const bool is_matrix = key == "camera_matrix" || key == "distortion_coefficients";
      if (!is_matrix) {
        const std::string missing = ErrorOf(Write("missing.yaml", WithKey(text, key, nullptr)));
        EXPECT_NE(missing.find("key " + prefix + key + " is missing"), std::string::npos)
            << format.file << ": " << missing;
        const std::string list = ErrorOf(Write("list.yaml", WithKey(text, key, "[1]")));
        EXPECT_NE(list.find("key " + prefix + key), std::string::npos) << format.file << ": " << list;
        const std::string word = ErrorOf(Write("word.yaml", WithKey(text, key, "nonsense")));
        EXPECT_NE(word.find("key " + prefix + key), std::string::npos) << format.file << ": " << word;
      } else {
        std::string other = text;
        other.replace(other.find(key), key.size(), "misspelt");
        const std::string missing = ErrorOf(Write("missing.yaml", other));
        EXPECT_NE(missing.find("key " + key + " is missing"), std::string::npos) << missing;
        other = text;
        other.replace(other.find("data:", other.find(key)), 5, "date:");
        const std::string empty = ErrorOf(Write("empty.yaml", other));
        EXPECT_NE(empty.find("key " + key + ".data is missing"), std::string::npos) << empty;
      }
    }
  }
}

TEST_F(ReadCameraTest, WhatCannotBeRightIsRefused) {
  const std::string opencv = ReadAll(std::string(MAPMEND_SOURCE_DIR) + "/data/cameras/opencv.yaml");
  const auto opencv_with = [&](const std::string& from, const std::string& to) {
    std::string text = opencv;
    return ErrorOf(Write("o.yaml", text.replace(text.find(from), from.size(), to)));
  };
  EXPECT_NE(opencv_with("0.01538, 0., 0., 0.", "0.01538, 0., 0., 0., 0.1, 0.2").find("7 coefficients"),
            std::string::npos);
  EXPECT_NE(opencv_with("478.25, 0., 399.5", "478.25, 2., 399.5").find("camera_matrix.data is not"), std::string::npos);
  EXPECT_NE(opencv_with("image_width: 800", "image_width: 800.5").find("image_width is not a number of pixels"),
            std::string::npos);
  EXPECT_NE(
      opencv_with("image_width: 800", "fisheye_model: maybe\nimage_width: 800").find("fisheye_model is \"maybe\""),
      std::string::npos);
  EXPECT_NE(ErrorOf(Write("cameras.txt", "1 OPENCV 800 600 478 478 400 x 0 0 0 0\n")).find("\"x\" is not a number"),
            std::string::npos);
  EXPECT_NE(
      ErrorOf(Write("cameras.txt", "1 OPENCV 800 600 478 478 400 300 0 0 0\n")).find("needs 8 parameters, it has 7"),
      std::string::npos);
  EXPECT_NE(ErrorOf(Write("cameras.txt", "1 PINHOLE 800 -600 478 478 400 300\n")).find("width and height"),
            std::string::npos);
  EXPECT_NE(ErrorOf(Write("cameras.txt", "# nothing\n\r\n")).find("no camera found"), std::string::npos);
  EXPECT_NE(ErrorOf(Write("other.yaml", "a: 1\n")).find("none of the keys"), std::string::npos);
  EXPECT_NE(ErrorOf(Write("empty.yaml", "")).find("no camera found"), std::string::npos);
  EXPECT_NE(ErrorOf(Write("k.yaml", "cam0: 5\n")).find("key cam0"), std::string::npos);
}

// Undistortion must undo the projection: a point's undistorted pixel is where the ideal camera sees it.
void ExpectUndistortInvertsProject(const Camera& camera, double reach) {
  const Pinhole ideal = camera.Ideal();
  for (double x = -reach; x <= reach; x += reach / 4) {
    for (double y = -reach; y <= reach; y += reach / 4) {
      const Eigen::Vector3d point(x, y, 1);
      const auto undistorted = camera.Undistort({camera.Project(point).cast<float>()});
      EXPECT_LT((undistorted[0].cast<double>() - ideal.Project(point)).norm(), 0.02) << x << " " << y;
    }
  }
}

TEST(Camera, UndistortInvertsProject) {
  Camera pinhole;
  pinhole.width = 800, pinhole.height = 600;
  pinhole.fx = pinhole.fy = 480, pinhole.cx = 400, pinhole.cy = 300;
  pinhole.distortion = {-0.12, 0.05, 0.001, -0.0005, 0.002};
  ExpectUndistortInvertsProject(pinhole, 0.8);
  Camera fisheye = pinhole;
  fisheye.model = Camera::Model::kFisheye;
  fisheye.distortion = {0.02, -0.01, 0.003, -0.0005, 0};
  ExpectUndistortInvertsProject(fisheye, 1.2);
}

TEST(Camera, ScalingKeepsWhereAPointIsSeen) {
  Camera camera;
  camera.width = 800, camera.height = 600;
  camera.fx = camera.fy = 480, camera.cx = 399.5, camera.cy = 299.5;
  const Camera half = camera.Scaled(0.5);
  EXPECT_EQ(half.width, 400);
  const Eigen::Vector2d large = camera.Project({0.1, 0.2, 1}), small = half.Project({0.1, 0.2, 1});
  EXPECT_NEAR((large.x() + 0.5) / 2 - 0.5, small.x(), 1e-9);
}

}  // namespace camera_test
}  // namespace mapmend
