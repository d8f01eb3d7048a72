#include "libs/bus/health.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <mapmend/health_t.hpp>
#include <optional>

#include "libs/bus/channels.h"
#include "tests/running_hub.h"

namespace mapmend {
namespace health_test {

class HealthTest : public ::testing::Test {
 protected:
  // The next health that done() is content with.
  std::optional<health_t> Hear(const std::function<bool(const health_t&)>& done) {
    std::optional<health_t> heard;
    const Subscription subscription =
        listener_.Subscribe<health_t>(channels::kHealth, Delivery::kKeepAll, [&](const health_t& health) {
          if (!heard && done(health)) heard = health;
        });
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!heard && std::chrono::steady_clock::now() < deadline) listener_.Handle(20);
    return heard;
  }

  RunningHub hub_;
  Bus bus_{hub_.Url(), ""}, listener_{hub_.Url(), ""};
};

double CounterOf(const health_t& health, const std::string& name) {
  for (const counter_t& counter : health.counters) {
    if (counter.name == name) return counter.value;
  }
  return -1;
}

TEST_F(HealthTest, TellsWhatItsOwnerHasSetAsOfItsLastSignOfLife) {
  HealthReporter reporter(&bus_, "merger");
  reporter.SetCounter("broadcasts", 3);
  reporter.SetCursor("s", 17);
  reporter.SetQueueDepth(5);
  reporter.SetState("busy", "refining");
  reporter.Tick();
  reporter.SetQueueDepth(6);  // not told before the next sign of life
  const auto health = Hear([](const health_t& h) { return h.state == "busy"; });
  ASSERT_TRUE(health);
  EXPECT_EQ(health->process, "merger");
  EXPECT_EQ(health->pid, getpid());
  EXPECT_EQ(health->host, HostName());
  EXPECT_FALSE(health->host.empty());
  EXPECT_EQ(health->message, "refining");
  EXPECT_EQ(CounterOf(*health, "broadcasts"), 3);
  ASSERT_EQ(health->num_cursors, 1);
  EXPECT_EQ(health->cursors[0].session, "s");
  EXPECT_EQ(health->cursors[0].seq, 17);
  EXPECT_EQ(health->queue_depth, 5);
  EXPECT_GT(health->rss_mb, 1);
  EXPECT_GE(health->peak_rss_mb, health->rss_mb);
}

TEST_F(HealthTest, WorkThatStandsStillIsTold) {
  HealthReporter reporter(&bus_, "merger");
  reporter.Tick();
  const auto health = Hear([](const health_t& h) { return CounterOf(h, "stalled_s") >= 1; });
  EXPECT_TRUE(health);
}

TEST_F(HealthTest, ASecondBusHearsItAsWell) {
  RunningHub other;
  Bus there(other.Url(), "");
  HealthReporter reporter(&there, "frontend");
  reporter.AlsoTo(&bus_);
  EXPECT_TRUE(Hear([](const health_t& h) { return h.process == "frontend"; }));
}

}  // namespace health_test
}  // namespace mapmend
