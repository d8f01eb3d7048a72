#include "libs/mosaic/ground_view.h"

#include <gtest/gtest.h>

#include "tests/unit/mosaic/synthetic_ground.h"

namespace mapmend {
namespace {

TEST(GroundView, SeesThePlaceBelowInTheMiddleOfTheImage) {
  const GroundView view(SyntheticGround::MakeCamera(), SyntheticGround::Above(3, 4, 10));
  const auto below = view.See({3, 4, 0});
  ASSERT_TRUE(below);
  EXPECT_LT((below->pixel - Eigen::Vector2d(160, 120)).norm(), 1e-9);
  EXPECT_NEAR(below->quality, 0.1, 1e-9);
  const auto north_east = view.See({4, 6, 0});  // 30 pixels a metre; north is up
  ASSERT_TRUE(north_east);
  EXPECT_LT((north_east->pixel - Eigen::Vector2d(190, 60)).norm(), 1e-9);
  EXPECT_LT(north_east->quality, below->quality);
  EXPECT_FALSE(view.See({20, 4, 0})) << "beside the image";
  EXPECT_FALSE(view.See({3, 4, 12})) << "above the camera";
}

TEST(GroundView, FootprintAndPixelSizeFollowFromHeightAndFocalLength) {
  const GroundView view(SyntheticGround::MakeCamera(), SyntheticGround::Above(3, 4, 12));
  const GroundSurface ground(2.0);
  double west = 1e9, east = -1e9;
  for (const Eigen::Vector2d& place : view.Footprint(ground)) {
    west = std::min(west, place.x());
    east = std::max(east, place.x());
  }
  EXPECT_NEAR(west, 3 - 10 * 160 / 300.0, 1e-6);
  EXPECT_NEAR(east, 3 + 10 * 159 / 300.0, 1e-6);
  EXPECT_NEAR(view.GroundSampleDistance(ground), 10 / 300.0, 1e-9);
  EXPECT_NEAR(view.Tilt(), 0, 1e-9);
}

TEST(GroundView, RaysThatGoUpEndFarAway) {
  const GroundView view(SyntheticGround::MakeCamera(), SyntheticGround::Above(0, 0, 10, 0, 1.4));
  EXPECT_NEAR(view.Tilt(), 1.4, 1e-9);
  for (const Eigen::Vector2d& place : view.Footprint(GroundSurface(0.0))) EXPECT_LT(place.norm(), 28);
}

// Beyond the radius at which the curve of a lens turns back, the model shows places inside the image that it does not
// see.
TEST(GroundView, ALensThatFoldsBackShowsNothingFromOutside) {
  Camera camera = SyntheticGround::MakeCamera();
  camera.distortion = {-0.25, 0, 0, 0, 0};
  const Rigid3 above = SyntheticGround::Above(0, 0, 10);
  const Eigen::Vector3d outside(17, 0, 0);
  const Eigen::Vector2d pixel = camera.Project(above * outside);
  ASSERT_TRUE(pixel.x() > 0 && pixel.x() < camera.width) << "the model alone would show it";
  EXPECT_FALSE(GroundView(camera, above).See(outside));
  EXPECT_TRUE(GroundView(camera, above).See({4, 0, 0}));
}

}  // namespace
}  // namespace mapmend
