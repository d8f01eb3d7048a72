#include "libs/geometry/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

namespace mapmend {
namespace {

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
  const Camera c = ReadCamera(Write("o.yaml",
                                    "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n"
                                    "   rows: 3\n   cols: 3\n   dt: d\n   data: [ 500., 0., 320., 0., 510., 240., 0., 0., 1. ]\n"
                                    "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
                                    "   data: [ 0.1, -0.2, 0.001, 0.002, 0.05 ]\n"));
  EXPECT_EQ(c.fy, 510);
  EXPECT_EQ(c.distortion[4], 0.05);
}

TEST_F(ReadCameraTest, ColmapPixelCentresAreHalfAPixelOff) {
  const Camera c = ReadCamera(Write("cameras.txt", "# comment\n1 OPENCV 640 480 500 510 320.5 240.5 0.1 0.2 0.3 0.4\n"));
  EXPECT_EQ(c.cx, 320);
  EXPECT_EQ(c.cy, 240);
  EXPECT_EQ(c.distortion[3], 0.4);
}

TEST_F(ReadCameraTest, ErrorsNameTheFileAndTheKey) {
  EXPECT_NE(ErrorOf("/no/such/camera.yaml").find("/no/such/camera.yaml"), std::string::npos);
  EXPECT_NE(ErrorOf(Write("a.yaml", "Camera.fx: 500\nCamera.fy: 500\nCamera.cx: 320\n")).find("Camera.cy is missing"), std::string::npos);
  EXPECT_NE(ErrorOf(Write("b.yaml", "Camera.fx: much\nCamera.fy: 500\nCamera.cx: 1\nCamera.cy: 1\n")).find("Camera.fx is not a number"),
            std::string::npos);
  EXPECT_NE(ErrorOf(Write("c.yaml", "Camera.fx: -5\nCamera.fy: 500\nCamera.cx: 1\nCamera.cy: 1\n")).find("positive"), std::string::npos);
  EXPECT_NE(ErrorOf(Write("cameras.txt", "1 FULL_OPENCV 640 480 1\n")).find("FULL_OPENCV"), std::string::npos);
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

}  // namespace
}  // namespace mapmend
