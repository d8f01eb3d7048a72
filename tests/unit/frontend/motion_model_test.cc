#include "procs/frontend/motion_model.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace {

FramePtr FrameAt(double x, double turn, double seconds) {
  auto frame = std::make_shared<Frame>();
  frame->utime = static_cast<int64_t>(1e6 * seconds);
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()));
  frame->cam_from_submap = Rigid3(rotation, {x, 0, 0}).Inverse();
  return frame;
}

TEST(MotionModel, GoesOnAsBetweenTheLastTwoFrames) {
  MotionModel motion{{}};
  EXPECT_FALSE(motion.Predict(0));
  motion.Add(FrameAt(0, 0, 0), true);
  EXPECT_FALSE(motion.Predict(1000000));
  motion.Add(FrameAt(1, 0, 1), true);
  const auto ahead = motion.Predict(3000000);
  ASSERT_TRUE(ahead);
  EXPECT_NEAR((ahead->Center() - Eigen::Vector3d(3, 0, 0)).norm(), 0, 1e-9);
  EXPECT_FALSE(motion.Predict(1000000));  // no time has passed
  EXPECT_TRUE(motion.Predict(3490000));
  EXPECT_FALSE(motion.Predict(3510000));  // more than 2.5 times the usual time
}

TEST(MotionModel, GoesOnTurning) {
  MotionModel motion{{}};
  motion.Add(FrameAt(0, 0.1, 0), true);
  motion.Add(FrameAt(0, 0.2, 1), true);
  const auto ahead = motion.Predict(2000000);
  ASSERT_TRUE(ahead);
  EXPECT_NEAR(ahead->rotation.angularDistance(FrameAt(0, 0.3, 2)->cam_from_submap.rotation), 0, 1e-9);
}

TEST(MotionModel, KnowsNoMotionAcrossALoss) {
  MotionModel motion{{}};
  motion.Add(FrameAt(0, 0, 0), true);
  motion.Add(FrameAt(1, 0, 1), false);
  EXPECT_FALSE(motion.Predict(2000000));
  EXPECT_FALSE(motion.IsAfterGap(60000000));
  EXPECT_EQ(motion.Last()->utime, 1000000);
}

TEST(MotionModel, AJumpIsLongAndLongerThanBefore) {
  MotionModel motion{{}};
  motion.Add(FrameAt(0, 0, 0), true);
  motion.Add(FrameAt(0.02, 0, 1), true);
  EXPECT_TRUE(motion.IsJump(*FrameAt(0.22, 0, 2), 1));     // ten steps, a fifth of the depth
  EXPECT_FALSE(motion.IsJump(*FrameAt(0.22, 0, 2), 2));    // a tenth of it
  EXPECT_FALSE(motion.IsJump(*FrameAt(0.11, 0, 2), 0.1));  // less than five steps
}

TEST(MotionModel, TellsThatImagesAreMissing) {
  MotionModel motion{{}};
  motion.Add(FrameAt(0, 0, 0), true);
  motion.Add(FrameAt(1, 0, 1), true);
  EXPECT_FALSE(motion.IsAfterGap(5900000));
  EXPECT_TRUE(motion.IsAfterGap(6100000));
}

}  // namespace
}  // namespace mapmend
