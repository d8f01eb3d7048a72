#include "procs/frontend/reach.h"

#include <gtest/gtest.h>

#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace reach_test {

constexpr int64_t kSecond = 1000000;

// A keyframe each second, one unit apart along x, the newest first.
WorkingMap Map(int num_keyframes, IdSource* ids) {
  WorkingMap map(SubmapId(0), {}, ids);
  for (int i = num_keyframes - 1; i >= 0; --i) {
    const auto frame = std::make_shared<Frame>();
    frame->utime = i * kSecond;
    map.AddKeyframe(frame, Rigid3(Eigen::Quaterniond::Identity(), {-1.0 * i, 0, 0}));
  }
  return map;
}

TEST(Reach, IsAsFarAsTheUsualSpeedAllowsFromBeforeAndFromAfter) {
  IdSource ids;
  const WorkingMap map = Map(5, &ids);
  EXPECT_TRUE(IsWithinReach(map, 5 * kSecond, {5, 0, 0}, 4));
  EXPECT_TRUE(IsWithinReach(map, 5 * kSecond, {4, 3.9, 0}, 4));
  EXPECT_FALSE(IsWithinReach(map, 5 * kSecond, {4, 4.1, 0}, 4)) << "in one second";
  EXPECT_TRUE(IsWithinReach(map, 10 * kSecond, {-10, 0, 0}, 4)) << "after six seconds";
  EXPECT_FALSE(IsWithinReach(map, -kSecond, {-5, 0, 0}, 4)) << "before the first";
  EXPECT_TRUE(IsWithinReach(map, 2 * kSecond + kSecond / 2, {2.5, 1.8, 0}, 4)) << "between two";
  EXPECT_FALSE(IsWithinReach(map, 2 * kSecond + kSecond / 2, {2.5, 2.1, 0}, 4));
}

TEST(Reach, IsUnknownWithoutASpeed) {
  IdSource ids;
  EXPECT_TRUE(IsWithinReach(Map(2, &ids), 5 * kSecond, {100, 0, 0}, 4));
}

// The frame itself may be a keyframe already.
TEST(Reach, IsNotThatFromTheSamePhoto) {
  IdSource ids;
  EXPECT_TRUE(IsWithinReach(Map(5, &ids), 2 * kSecond, {2, 0.5, 0}, 4));
}

}  // namespace reach_test
}  // namespace mapmend
