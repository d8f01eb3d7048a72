#include "procs/frontend/position_input.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "libs/bus/channels.h"
#include "libs/wire/stream_codec.h"
#include "tests/running_hub.h"

namespace mapmend {
namespace position_input_test {

PositionFix Fix(int second, double latitude = 50) {
  PositionFix fix;
  fix.utime = 1700000000000000 + second * int64_t{1000000};
  fix.latitude_deg = latitude + 1e-5 * second;
  fix.longitude_deg = 8;
  return fix;
}

TEST(PositionInput, LivePositionsAreTakenInOrderAndBadOnesDropped) {
  RunningHub hub;
  PositionInput input({}, std::make_unique<LivePositions>(hub.Url(), "p_"));
  Bus receiver(hub.Url(), "p_");
  // Until the subscription is there, nothing arrives.
  std::vector<PositionFix> taken;
  int second = 0;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  const auto take = [&] {
    const std::vector<PositionFix> some = input.TakeFor(0, 0);
    taken.insert(taken.end(), some.begin(), some.end());
  };
  while (taken.empty() && std::chrono::steady_clock::now() < deadline) {
    receiver.Publish(channels::kGps, Fix(second++));
    receiver.Handle(20);
    take();
  }
  ASSERT_FALSE(taken.empty());
  receiver.Publish(channels::kGps, Fix(second++, 0.001));  // far away
  receiver.Publish(channels::kGps, Fix(0));                // of the past
  const PositionFix last = Fix(second);
  receiver.Publish(channels::kGps, last);
  while (taken.back().utime != last.utime && std::chrono::steady_clock::now() < deadline) {
    receiver.Handle(20);
    take();
  }
  ASSERT_EQ(taken.back().utime, last.utime);
  for (size_t i = 1; i < taken.size(); ++i) EXPECT_GT(taken[i].utime, taken[i - 1].utime);
  EXPECT_EQ(input.NumBad(), 2);
  EXPECT_EQ(input.NumTold(), static_cast<int64_t>(taken.size()));
}

}  // namespace position_input_test
}  // namespace mapmend
