// Real time: a file at the pace of its times, a camera on the bus. What comes while the frontend is busy is dropped and
// counted.

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <functional>
#include <map>
#include <mapmend/health_t.hpp>
#include <mapmend/image_t.hpp>
#include <nlohmann/json.hpp>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace live_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

std::string FreeUrl() {
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof(address);
  bind(fd, reinterpret_cast<sockaddr*>(&address), length);
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
  close(fd);
  return "tcpq://127.0.0.1:" + std::to_string(ntohs(address.sin_port));
}

nlohmann::json Summary(const std::string& out) { return nlohmann::json::parse(ReadText(out + "/summary.json")); }

std::vector<std::string> LiveArguments(const std::string& out, const std::string& url) {
  return {kProgram, "run", "--live",    "--camera", kFlight + "camera.yaml", "--out", out,
          "--port", "0",   "--lcm-url", url};
}

// The last health message of a live frontend.
class FrontendHealth {
 public:
  explicit FrontendHealth(const std::string& url) : bus_(url, "") {
    subscription_ = bus_.Subscribe<health_t>(channels::kHealth, Delivery::kKeepAll, [this](const health_t& health) {
      if (health.process != "frontend") return;
      state_ = health.state;
      message_ = health.message;
      for (const counter_t& counter : health.counters) counters_[counter.name] = counter.value;
    });
  }
  template <typename Condition>
  bool WaitFor(Condition condition, double timeout_s) {
    return WaitUntil(
        [&] {
          bus_.Handle(20);
          return condition();
        },
        timeout_s);
  }
  Bus* bus() { return &bus_; }
  const std::string& State() const { return state_; }
  const std::string& Message() const { return message_; }
  double Counter(const std::string& name) { return counters_[name]; }

 private:
  Bus bus_;
  Subscription subscription_;
  std::string state_, message_;
  std::map<std::string, double> counters_;
};

TEST(Realtime, AFrontendThatIsTooSlowDropsFramesAndSaysHowMany) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  const CommandResult result =
      RunCommand({kProgram, "run", kFlight + "video.mp4", "--realtime", "--speed", "5000", "--out", out, "--port", "0"},
                 kPatienceS);
  ASSERT_TRUE(result.exit_code == 0 || result.exit_code == 4) << result.output;
  const nlohmann::json summary = Summary(out);
  const int dropped = summary["frontend"]["frames_dropped"], read = summary["frames_in"];
  EXPECT_EQ(summary["frontend"]["mode"], "realtime");
  EXPECT_GT(dropped, 0);
  EXPECT_EQ(dropped + read, 172);
  EXPECT_NE(result.output.find(std::to_string(dropped) + " frames that came while the frontend was busy"),
            std::string::npos)
      << result.output;
  EXPECT_NE(
      ReadText(out + "/logs/frontend.log").find(std::to_string(dropped) + " frames came while the frontend was busy"),
      std::string::npos);
}

TEST(Live, ACameraOnTheBusGivesAMap) {
  const TemporaryFolder folder;
  const std::string out = folder / "out", url = FreeUrl();
  RunningCommand run(LiveArguments(out, url), folder / "run");
  const CommandResult published = RunCommand(
      {kProgram, "publish", kFlight + "video.mp4", "--skip-frames", "30-171", "--speed", "15", "--lcm-url", url},
      kPatienceS);
  ASSERT_EQ(published.exit_code, 0) << published.output << ReadText(folder / "run");
  EXPECT_NE(published.output.find("30 images published"), std::string::npos) << published.output;
  const auto result = run.Wait(kPatienceS);
  ASSERT_TRUE(result) << ReadText(folder / "run");
  ASSERT_EQ(result->exit_code, 0) << result->output;
  EXPECT_EQ(run.Survivors(), std::vector<pid_t>());
  const nlohmann::json summary = Summary(out);
  const int dropped = summary["frontend"]["frames_dropped"], read = summary["frames_in"],
            tracked = summary["frames_tracked"];
  EXPECT_EQ(summary["frontend"]["mode"], "live");
  EXPECT_EQ(summary["frontend"]["bad_messages"], 0);
  EXPECT_EQ(dropped + read, 30);
  EXPECT_GE(read, 20) << result->output;
  EXPECT_GE(tracked, 0.8 * read) << result->output;
  EXPECT_GT(summary["points_in_main"].get<int>(), 500);
}

TEST(Live, BadImagesAreCountedAndDroppedAndCtrlCEndsTheFlight) {
  const TemporaryFolder folder;
  const std::string out = folder / "out", url = FreeUrl();
  RunningCommand run(LiveArguments(out, url), folder / "run");
  FrontendHealth frontend(url);
  ASSERT_TRUE(frontend.WaitFor([&] { return frontend.State() == "ready"; }, 60)) << ReadText(folder / "run");

  image_t grey{};
  grey.format = image_t::GREY8;
  grey.width = 800;
  grey.height = 600;
  grey.num_bytes = 800 * 600;
  grey.data.assign(800 * 600, 128);
  image_t small = grey, unknown = grey, cut = grey, no_jpeg = grey;
  small.width = 400;
  unknown.format = 5;
  cut.data.resize(1000);
  cut.num_bytes = 1000;
  no_jpeg.format = image_t::JPEG;
  // One at a time, until it is counted: on a busy machine the bus may keep only the newest image.
  int num_bad = 0;
  const auto is_refused = [&](const std::function<bool()>& publish) {
    for (int i = 0; i < 10; ++i) {
      EXPECT_TRUE(publish());
      if (!frontend.WaitFor([&] { return frontend.Counter("bad_messages") > num_bad; }, 5)) continue;
      num_bad = static_cast<int>(frontend.Counter("bad_messages"));
      return true;
    }
    return false;
  };
  for (const image_t* bad : {&small, &unknown, &cut, &no_jpeg})
    EXPECT_TRUE(is_refused([&] { return frontend.bus()->Publish(channels::kImage, *bad); }));
  const uint8_t garbage[] = {1, 2, 3};
  EXPECT_TRUE(is_refused([&] { return frontend.bus()->PublishRaw(channels::kImage, garbage, 3); }));
  EXPECT_NE(frontend.Message().find("images are refused"), std::string::npos) << frontend.Message();

  const CommandResult published = RunCommand({kProgram, "publish", kFlight + "video.mp4", "--skip-frames", "8-171",
                                              "--speed", "12", "--no-end", "--format", "grey", "--lcm-url", url},
                                             120);
  ASSERT_EQ(published.exit_code, 0) << published.output;
  EXPECT_TRUE(
      frontend.WaitFor([&] { return frontend.Counter("frames") + frontend.Counter("frames_dropped") == 8; }, 30));
  // One end of the stream may be anybody's: it ends nothing.
  ASSERT_TRUE(frontend.bus()->Publish(channels::kImage, image_t{}));
  grey.utime = 1;  // long before the flight
  EXPECT_TRUE(is_refused([&] { return frontend.bus()->Publish(channels::kImage, grey); }));

  run.Signal(SIGINT);
  const auto result = run.Wait(60);
  ASSERT_TRUE(result) << ReadText(folder / "run");
  EXPECT_EQ(result->exit_code, 0) << result->output;
  EXPECT_EQ(run.Survivors(), std::vector<pid_t>());
  const nlohmann::json summary = Summary(out);
  EXPECT_GE(num_bad, 6);
  EXPECT_GE(summary["frontend"]["bad_messages"], num_bad);
  EXPECT_EQ(summary["frames_in"].get<int>() + summary["frontend"]["frames_dropped"].get<int>(), 8);
  EXPECT_TRUE(summary["sessions"][0]["ended"].get<bool>());
  EXPECT_TRUE(std::filesystem::exists(out + "/report.html"));
}

TEST(Live, WithoutAnyImageCtrlCSaysSo) {
  const TemporaryFolder folder;
  const std::string url = FreeUrl();
  RunningCommand run(LiveArguments(folder / "out", url), folder / "run");
  FrontendHealth frontend(url);
  ASSERT_TRUE(frontend.WaitFor([&] { return frontend.State() == "ready"; }, 60)) << ReadText(folder / "run");
  run.Signal(SIGINT);
  const auto result = run.Wait(30);
  ASSERT_TRUE(result) << ReadText(folder / "run");
  EXPECT_EQ(result->exit_code, 1);
  EXPECT_NE(result->output.find("no image came on channel MAPMEND_IMAGE"), std::string::npos) << result->output;
}

}  // namespace live_test
}  // namespace mapmend
