#include "procs/frontend/initial_keyframes.h"

#include <gtest/gtest.h>

#include "procs/frontend/keyframe_policy.h"
#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace {

// A view as one of a beginning, whose features see the points in their order.
FramePtr ViewOf(const std::vector<Eigen::Vector3d>& points, const Pinhole& camera, const Rigid3& pose) {
  auto frame = std::make_shared<Frame>();
  for (const Eigen::Vector3d& x : points) {
    Keypoint keypoint;
    keypoint.pixel = camera.Project(pose * x).cast<float>();
    frame->features.keypoints.push_back(keypoint);
    frame->features.descriptors.push_back({});
    frame->features.colors.push_back({});
  }
  frame->cam_from_submap = pose;
  frame->points.assign(points.size(), -1);
  return frame;
}

TEST(InitialKeyframes, ViewsBecomeKeyframesInTheOrderOfTime) {
  const Pinhole camera{500, 500, 320, 240, 640, 480};
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 40; ++i) points.emplace_back(0.1 * (i % 8) - 0.4, 0.1 * (i / 8) - 0.2, 1 + 0.01 * i);
  const auto at = [](double x) { return Rigid3(Eigen::Quaterniond::Identity(), {-x, 0, 0}); };
  Initialization beginning;
  beginning.first = ViewOf(points, camera, at(0));
  beginning.second = ViewOf(points, camera, at(0.1));
  beginning.second_from_first = at(0.1);
  beginning.between.push_back({ViewOf(points, camera, at(0.05)), at(0.05), {}});
  for (int i = 0; i < 40; ++i) {
    beginning.points.push_back({i, i, points[i]});
    beginning.between[0].features.push_back(i % 2 == 0 ? i : -1);
  }
  IdSource ids;
  WorkingMap map(SubmapId(0), Pyramid(), &ids);
  const InitialKeyframes keyframes = AddInitialKeyframes(beginning, &map);
  EXPECT_EQ(keyframes.first, 0);
  EXPECT_EQ(keyframes.second, 2);
  ASSERT_EQ(map.Keyframes().size(), 3u);
  EXPECT_EQ(map.Keyframe(1).frame, beginning.between[0].frame);
  EXPECT_EQ(map.Keyframe(1).frame->cam_from_submap.translation.x(), -0.05);
  EXPECT_EQ(map.PointsOf(1).size(), 20u);
  EXPECT_EQ(map.PointsOf(2).size(), 40u);
  EXPECT_TRUE(IsInitialView(beginning, *beginning.between[0].frame));

  // Twice as far away the points are seen under twice the angle; at the second view's place nothing is new.
  const auto growth = [&](double x) {
    const FramePtr frame = ViewOf(points, camera, at(x));
    for (int i = 0; i < 40; ++i) frame->points[i] = map.PointsOf(0)[i];
    return ParallaxGrowth(map, *frame);
  };
  EXPECT_NEAR(growth(0.2), 2, 0.1);
  EXPECT_NEAR(growth(0.1), 1, 0.01);
  EXPECT_NEAR(growth(-0.1), 2, 0.1);
  EXPECT_EQ(ParallaxGrowth(map, *ViewOf(points, camera, at(0))), 0);
}

}  // namespace
}  // namespace mapmend
