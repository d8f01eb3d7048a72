// The example camera files say what their README says: four of them describe one and the same camera.

#include <gtest/gtest.h>

#include "libs/geometry/camera.h"

namespace mapmend {
namespace camera_examples_test {

const std::string kFolder = std::string(MAPMEND_SOURCE_DIR) + "/data/cameras/";

TEST(CameraExamples, FourFormatsOfOneCamera) {
  const Camera bundled = ReadCamera(std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/camera.yaml");
  for (const char* name : {"orb_slam.yaml", "kalibr.yaml", "opencv.yaml", "colmap_cameras.txt"}) {
    const Camera camera = ReadCamera(kFolder + name);
    EXPECT_EQ(camera.model, Camera::Model::kPinhole) << name;
    EXPECT_EQ(camera.width, 800) << name;
    EXPECT_EQ(camera.height, 600) << name;
    EXPECT_DOUBLE_EQ(camera.fx, bundled.fx) << name;
    EXPECT_DOUBLE_EQ(camera.fy, bundled.fy) << name;
    EXPECT_DOUBLE_EQ(camera.cx, bundled.cx) << name;
    EXPECT_DOUBLE_EQ(camera.cy, bundled.cy) << name;
    EXPECT_EQ(camera.distortion, bundled.distortion) << name;
  }
}

TEST(CameraExamples, Fisheye) {
  const Camera camera = ReadCamera(kFolder + "orb_slam_fisheye.yaml");
  EXPECT_EQ(camera.model, Camera::Model::kFisheye);
  EXPECT_DOUBLE_EQ(camera.fx, 190.978);
  EXPECT_DOUBLE_EQ(camera.distortion[3], 0.0002029367);
}

}  // namespace camera_examples_test
}  // namespace mapmend
