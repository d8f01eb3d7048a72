#include "libs/mosaic/ground_view.h"

#include <gtest/gtest.h>

#include "tests/unit/mosaic/synthetic_ground.h"

namespace mapmend {
namespace ground_view_test {

TEST(GroundView, SeesThePlaceBelowInTheMiddleOfTheImage) {
  const GroundView view(SyntheticGround::MakeCamera(), SyntheticGround::Above(3, 4, 10));
  const auto below = view.See({3, 4, 0});
  ASSERT_TRUE(below);
  EXPECT_LT((below->pixel - Eigen::Vector2d(160, 120)).norm(), 1e-9);
  EXPECT_NEAR(view.Quality(below->steepness, below->inside), 0.1, 1e-9);
  const auto north_east = view.See({4, 6, 0});  // 30 pixels a metre; north is up
  ASSERT_TRUE(north_east);
  EXPECT_LT((north_east->pixel - Eigen::Vector2d(190, 60)).norm(), 1e-9);
  EXPECT_LT(north_east->steepness, below->steepness);
  EXPECT_EQ(view.Quality(0.1, -1), 0) << "outside the image";
  EXPECT_LT(view.Quality(0.1, 5), view.Quality(0.1, 50)) << "near its border";
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

// Against the definition: each line has a pose of its own.
TEST(GroundView, ARollingShutterIsWhereTheCameraWasWhenItReadTheLine) {
  const Camera camera = SyntheticGround::MakeCamera();
  const Rigid3 middle = SyntheticGround::Above(0, 0, 10);
  ReadoutMotion motion;
  motion.shift = {0.4, -0.3, 0.1};
  motion.turn = {0.02, 0.01, -0.03};
  for (const bool by_columns : {false, true}) {
    motion.by_columns = by_columns;
    const GroundView view(camera, middle, motion);
    for (const Eigen::Vector3d& place : {Eigen::Vector3d(2, 3, 0), Eigen::Vector3d(-4, -2, 1)}) {
      const auto sight = view.Project(place);
      ASSERT_TRUE(sight);
      const double when = by_columns ? sight->pixel.x() / camera.width - 0.5 : sight->pixel.y() / camera.height - 0.5;
      // The camera has gone by so much since the middle line, in its own frame.
      const Eigen::Vector3d turn = when * motion.turn;
      const Rigid3 middle_from_then(Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized())),
                                    when * motion.shift);
      const Eigen::Vector2d pixel = camera.Project(middle_from_then.Inverse() * (middle * place));
      EXPECT_LT((pixel - sight->pixel).norm(), 0.3) << "pixels; to first order in the motion";
      EXPECT_GT((camera.Project(middle * place) - sight->pixel).norm(), 1) << "it makes a difference";
    }
  }
}

}  // namespace ground_view_test
}  // namespace mapmend
