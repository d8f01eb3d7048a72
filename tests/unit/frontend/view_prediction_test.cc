#include "procs/frontend/view_prediction.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace view_prediction_test {

const Pinhole kCamera{500, 500, 400, 300, 800, 600};

// A point that is usually seen from the origin.
WorkingPoint PointAt(const Eigen::Vector3d& position) {
  WorkingPoint point;
  point.position = position;
  point.normal = -position.normalized();
  return point;
}

TEST(PredictView, TellsPixelAndDistance) {
  // Turned by 90 degrees about its axis, one unit behind the origin.
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()));
  const Viewpoint from(kCamera, Rigid3(turn, {0, 0, 1}));
  const auto view = PredictView(from, PointAt({0.5, 0, 4}), 0.5);
  ASSERT_TRUE(view);
  EXPECT_NEAR((view->pixel - Eigen::Vector2d(400, 350)).norm(), 0, 1e-9);
  EXPECT_NEAR(view->distance, std::hypot(0.5, 5), 1e-12);
}

TEST(PredictView, NothingIsSeenBehindTheCameraOrOutsideItsImage) {
  const Viewpoint from(kCamera, Rigid3());
  EXPECT_FALSE(PredictView(from, PointAt({0, 0, -1}), kFromAnyDirection));
  EXPECT_TRUE(PredictView(from, PointAt({-0.8, -0.6, 1}), kFromAnyDirection));  // pixel (0, 0)
  EXPECT_FALSE(PredictView(from, PointAt({-0.802, 0, 1}), kFromAnyDirection));
  EXPECT_TRUE(PredictView(from, PointAt({0.798, 0.598, 1}), kFromAnyDirection));  // pixel (799, 599)
  EXPECT_FALSE(PredictView(from, PointAt({0.802, 0, 1}), kFromAnyDirection));
  EXPECT_FALSE(PredictView(from, PointAt({0, 0.602, 1}), kFromAnyDirection));
}

TEST(PredictView, APointIsNotSeenFromFarOffItsUsualDirection) {
  const Viewpoint from(kCamera, Rigid3());
  for (const double angle : {55.0, 65.0, 180.0}) {
    WorkingPoint point = PointAt({0, 0, 1});
    point.normal = Eigen::AngleAxisd(angle * M_PI / 180, Eigen::Vector3d::UnitY()) * point.normal;
    EXPECT_EQ(PredictView(from, point, 0.5).has_value(), angle < 60) << angle;
    EXPECT_TRUE(PredictView(from, point, kFromAnyDirection)) << angle;
  }
}

}  // namespace view_prediction_test
}  // namespace mapmend
