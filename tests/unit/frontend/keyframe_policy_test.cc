#include "procs/frontend/keyframe_policy.h"

#include <gtest/gtest.h>

#include <cmath>

namespace mapmend {
namespace keyframe_policy_test {

KeyframeEvidence Comfortable() { return {200, 250, std::cos(2.9 * M_PI / 180)}; }

TEST(KeyframePolicy, AFrameThatSeesWhatItsKeyframeSeesIsNone) {
  EXPECT_FALSE(KeyframePolicy({}).NeedsKeyframe(Comfortable()));
}

TEST(KeyframePolicy, FewSharedPointsFewPointsOrParallaxCallForOne) {
  const KeyframePolicy policy({});
  KeyframeEvidence evidence = Comfortable();
  evidence.solid_points = 290;  // 0.69 of them are seen
  EXPECT_TRUE(policy.NeedsKeyframe(evidence));
  EXPECT_TRUE(policy.NeedsKeyframe({99, 99, 1}));
  EXPECT_FALSE(policy.NeedsKeyframe({100, 100, 1}));
  evidence = Comfortable();
  evidence.cos_angle = std::cos(3.1 * M_PI / 180);
  EXPECT_TRUE(policy.NeedsKeyframe(evidence));
  evidence = Comfortable();
  evidence.turn_deg = 13;
  EXPECT_FALSE(policy.NeedsKeyframe(evidence));
  evidence.turn_deg = 15;
  EXPECT_TRUE(policy.NeedsKeyframe(evidence));
}

TEST(KeyframePolicy, IsUrgentBeforeTheSubmapMightBeLost) {
  EXPECT_TRUE(KeyframePolicy({}).IsUrgent(49));
  EXPECT_FALSE(KeyframePolicy({}).IsUrgent(50));
}

FramePtr FrameWithFeatures(int count) {
  auto frame = std::make_shared<Frame>();
  frame->features.keypoints.resize(count);
  frame->features.descriptors.resize(count);
  return frame;
}

Rigid3 PoseAt(double x) { return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(-x, 0, 0)}; }

// Points one unit ahead of keyframes side by side; all keyframes see the first, the first two see the second.
struct SmallMap {
  explicit SmallMap(int num_keyframes) {
    for (int i = 0; i < num_keyframes; ++i) map.AddKeyframe(FrameWithFeatures(2), PoseAt(0.1 * i));
    for (FeatureIndex feature(0); feature < 2; ++feature) {
      const PointIndex point = map.AddPoint(Eigen::Vector3d(0, 0, 1), KeyframeIndex(0));
      const int num_observers = feature == 0 ? num_keyframes : 2;
      for (KeyframeIndex k(0); k < num_observers; ++k) map.AddObservation(point, k, feature);
    }
  }
  IdSource ids;
  WorkingMap map{SubmapId(0), Pyramid(), &ids};
};

TEST(KeyframePolicy, MeasuresSolidPointsAndTheAngleOfTheRays) {
  const KeyframePolicy policy({});
  const SmallMap later(4), early(3);
  TrackResult tracked;
  tracked.num_inliers = 1;
  tracked.reference_keyframe = KeyframeIndex(0);
  tracked.cam_from_submap = PoseAt(0.1);
  tracked.points = {PointIndex(0), PointIndex()};
  const KeyframeEvidence evidence = policy.Measure(later.map, tracked);
  EXPECT_EQ(evidence.num_inliers, 1);
  EXPECT_EQ(evidence.solid_points, 1);  // the second was seen by two keyframes only
  EXPECT_NEAR(std::acos(evidence.cos_angle), std::atan(0.1), 1e-9);
  EXPECT_EQ(policy.Measure(early.map, tracked).solid_points, 2);
}

// The view turns to the side, or up; a camera that turns about its axis goes on to see the same.
TEST(KeyframePolicy, MeasuresHowFarTheViewHasTurned) {
  const SmallMap map(4);
  TrackResult tracked;
  tracked.reference_keyframe = KeyframeIndex(0);
  tracked.points = {PointIndex(), PointIndex()};
  const auto turn = [&](const Eigen::Vector3d& about) {
    tracked.cam_from_submap = {Eigen::Quaterniond(Eigen::AngleAxisd(0.3, about)), Eigen::Vector3d::Zero()};
    return KeyframePolicy({}).Measure(map.map, tracked).turn_deg;
  };
  EXPECT_NEAR(turn(Eigen::Vector3d::UnitX()), 0.3 * 180 / M_PI, 1e-6);
  EXPECT_NEAR(turn(Eigen::Vector3d::UnitY()), 0.3 * 180 / M_PI, 1e-6);
  EXPECT_NEAR(turn(Eigen::Vector3d::UnitZ()), 0, 1e-5);
}

}  // namespace keyframe_policy_test
}  // namespace mapmend
