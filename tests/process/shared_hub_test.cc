// Two runs on one hub, on the same channels: both stores would take what either frontend says.

#include <gtest/gtest.h>

#include <mapmend/health_t.hpp>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "tests/process/command_helper.h"
#include "tests/running_hub.h"

namespace mapmend {
namespace shared_hub_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

// The run's store is up; another one, that nobody could hear of before, says that it is there, too.
TEST(SharedHub, AStoreThatComesUpAtTheSameTimeEndsTheRunWithALine) {
  const TemporaryFolder folder;
  const RunningHub hub;
  Bus bus(hub.Url(), "");
  bool is_up = false;
  const Subscription subscription =
      bus.Subscribe<health_t>(channels::kHealth, Delivery::kKeepAll,
                              [&](const health_t& health) { is_up = is_up || health.process == "submap_store"; });
  RunningCommand run({kProgram, "run", kFlight + "video.mp4", "--lcm-url", hub.Url(), "--port", "0", "--mosaic", "none",
                      "--out", folder / "out"},
                     folder / "run");
  ASSERT_TRUE(WaitUntil(
      [&] {
        bus.Handle(10);
        return is_up;
      },
      60))
      << ReadText(folder / "run");
  health_t other{};
  other.process = "submap_store";
  other.pid = 999999999;  // above any that a kernel gives
  other.state = "ready";
  ASSERT_TRUE(bus.Publish(channels::kHealth, other));
  const auto result = run.Wait(60);
  ASSERT_TRUE(result) << ReadText(folder / "run");
  EXPECT_EQ(result->exit_code, 1);
  EXPECT_NE(result->output.find("another run began on " + hub.Url() + " at the same time"), std::string::npos)
      << result->output;
  EXPECT_EQ(run.SurvivorsAfter(10), std::vector<pid_t>());
}

}  // namespace shared_hub_test
}  // namespace mapmend
