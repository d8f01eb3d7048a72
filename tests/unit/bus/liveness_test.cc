#include "libs/bus/liveness.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace liveness_test {

using std::chrono::milliseconds;

constexpr int kBaseMs = 3500, kMaxMs = 20000;

class LivenessTest : public ::testing::Test {
 protected:
  Liveness::Clock::time_point At(int ms) const { return start_ + milliseconds(ms); }
  // A ping and its answer.
  void Ping(int at_ms, int took_ms) {
    liveness_.OnPingSent(At(at_ms));
    liveness_.OnPong(At(at_ms + took_ms));
  }

  Liveness::Clock::time_point start_ = Liveness::Clock::now();
  Liveness liveness_{kBaseMs, kMaxMs};
};

TEST_F(LivenessTest, APingASecondAndNoneWhileOneIsOnItsWay) {
  liveness_.OnPingSent(At(0));
  EXPECT_FALSE(liveness_.PingIsDue(At(5000)));
  liveness_.OnPong(At(5000));
  EXPECT_TRUE(liveness_.PingIsDue(At(5000)));
  Ping(6000, 10);
  EXPECT_FALSE(liveness_.PingIsDue(At(6500)));
  EXPECT_TRUE(liveness_.PingIsDue(At(7000)));
}

TEST_F(LivenessTest, NobodyIsDeadWhoIsNotAsked) { EXPECT_FALSE(liveness_.IsDead(At(1000000))); }

TEST_F(LivenessTest, SilenceAfterAPingIsDeathAndAnySignIsLife) {
  Ping(0, 10);
  liveness_.OnPingSent(At(1000));
  EXPECT_FALSE(liveness_.IsDead(At(1000 + kBaseMs - 1)));
  EXPECT_TRUE(liveness_.IsDead(At(1000 + kBaseMs)));
  liveness_.OnSign(At(3000));
  EXPECT_FALSE(liveness_.IsDead(At(1000 + kBaseMs)));
  EXPECT_TRUE(liveness_.IsDead(At(3000 + kBaseMs)));
}

TEST_F(LivenessTest, ASlowLinkHasMoreTimeUpToALimit) {
  Ping(0, 1000);
  EXPECT_EQ(liveness_.DeadAfterMs(), 8000);
  Ping(2000, 60000);
  EXPECT_EQ(liveness_.DeadAfterMs(), kMaxMs);
}

TEST_F(LivenessTest, WhatPingsUsuallyTakeFallsSlowly) {
  Ping(0, 1000);
  Ping(2000, 500);
  EXPECT_EQ(liveness_.DeadAfterMs(), 8 * 950);
}

}  // namespace liveness_test
}  // namespace mapmend
