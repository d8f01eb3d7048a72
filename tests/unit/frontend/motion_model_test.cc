#include "procs/frontend/motion_model.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace motion_model_test {

FramePtr FrameAt(double seconds) {
  auto frame = std::make_shared<Frame>();
  frame->utime = static_cast<int64_t>(1e6 * seconds);
  return frame;
}

Rigid3 PoseAt(double x, double turn = 0) {
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()));
  return Rigid3(rotation, {x, 0, 0}).Inverse();
}

void Add(double x, double turn, double seconds, MotionModel* motion, bool follows = true) {
  motion->Add(FrameAt(seconds), PoseAt(x, turn), KeyframeIndex(), follows);
}

TEST(MotionModel, GoesOnAsBetweenTheLastTwoFrames) {
  MotionModel motion{{}};
  EXPECT_FALSE(motion.Predict(0));
  Add(0, 0, 0, &motion);
  EXPECT_FALSE(motion.Predict(1000000));
  Add(1, 0, 1, &motion);
  const auto ahead = motion.Predict(3000000);
  ASSERT_TRUE(ahead);
  EXPECT_NEAR((ahead->Center() - Eigen::Vector3d(3, 0, 0)).norm(), 0, 1e-9);
  EXPECT_FALSE(motion.Predict(1000000));  // no time has passed
  EXPECT_TRUE(motion.Predict(3490000));
  EXPECT_FALSE(motion.Predict(3510000));  // more than 2.5 times the usual time
}

TEST(MotionModel, GoesOnTurning) {
  MotionModel motion{{}};
  Add(0, 0.1, 0, &motion);
  Add(0, 0.2, 1, &motion);
  const auto ahead = motion.Predict(2000000);
  ASSERT_TRUE(ahead);
  EXPECT_NEAR(ahead->rotation.angularDistance(PoseAt(0, 0.3).rotation), 0, 1e-9);
}

TEST(MotionModel, KnowsNoMotionAcrossALoss) {
  MotionModel motion{{}};
  Add(0, 0, 0, &motion);
  Add(1, 0, 1, &motion, false);
  EXPECT_FALSE(motion.Predict(2000000));
  EXPECT_FALSE(motion.IsAfterGap(60000000));
  EXPECT_EQ(motion.Last()->utime, 1000000);
}

TEST(MotionModel, AJumpIsLongAndLongerThanBefore) {
  MotionModel motion{{}};
  Add(0, 0, 0, &motion);
  Add(0.02, 0, 1, &motion);
  EXPECT_TRUE(motion.IsJump(PoseAt(0.22), 1));     // ten steps, a fifth of the depth
  EXPECT_FALSE(motion.IsJump(PoseAt(0.22), 2));    // a tenth of it
  EXPECT_FALSE(motion.IsJump(PoseAt(0.11), 0.1));  // less than five steps
}

TEST(MotionModel, KeyframesHaveThePosesThatTheMapGivesThem) {
  IdSource ids;
  WorkingMap map(SubmapId(0), {}, &ids);
  MotionModel motion{{}};
  for (int i = 0; i < 2; ++i) {
    const FramePtr frame = FrameAt(i);
    motion.Add(frame, PoseAt(i), map.AddKeyframe(frame, PoseAt(i)), true);
  }
  map.SetPose(KeyframeIndex(1), PoseAt(1.5));
  EXPECT_NEAR(motion.Predict(2000000)->Center().x(), 2, 1e-9);
  motion.Refresh(map);
  EXPECT_NEAR(motion.Predict(2000000)->Center().x(), 3, 1e-9);
  map.SetPose(KeyframeIndex(0), PoseAt(0.5));
  motion.Refresh(map);
  EXPECT_NEAR(motion.Predict(2000000)->Center().x(), 2.5, 1e-9);
}

TEST(MotionModel, TellsThatImagesAreMissing) {
  MotionModel motion{{}};
  Add(0, 0, 0, &motion);
  Add(1, 0, 1, &motion);
  EXPECT_FALSE(motion.IsAfterGap(5900000));
  EXPECT_TRUE(motion.IsAfterGap(6100000));
}

}  // namespace motion_model_test
}  // namespace mapmend
