// The real viewer_export beside a real store on a real hub: it must follow the stream, wait for the final revision,
// write the exports, and also find a final revision that was stored before it was started.

#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <mapmend/health_t.hpp>
#include <nlohmann/json.hpp>
#include <thread>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/bus/hub.h"
#include "libs/wire/store_client.h"
#include "libs/wire/stream_sender.h"

extern char** environ;

namespace mapmend {
namespace viewer_export_test {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr char kSession[] = "77777777-0000-0000-0000-000000000001";

class Process {
 public:
  explicit Process(std::vector<std::string> words) {
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    if (posix_spawn(&pid_, argv[0], nullptr, nullptr, argv.data(), environ) != 0) pid_ = -1;
  }
  ~Process() { Stop(); }
  // Exit code after SIGTERM; -1 if it did not exit by itself.
  int Stop() {
    if (pid_ <= 0) return -1;
    kill(pid_, SIGTERM);
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t pid_ = -1;
};

class ViewerExportTest : public ::testing::Test {
 protected:
  ViewerExportTest()
      : dir_(fs::temp_directory_path() / ("mapmend_viewer_" + std::to_string(getpid()))), hub_(Options()) {
    fs::create_directories(dir_);
    url_ = "tcpq://127.0.0.1:" + std::to_string(hub_.Port());
    hub_thread_ = std::thread([this] {
      while (!stop_) hub_.Spin(20);
    });
  }
  ~ViewerExportTest() override {
    stop_ = true;
    hub_thread_.join();
    fs::remove_all(dir_);
  }
  static HubOptions Options() {
    HubOptions options;
    options.port = 0;
    return options;
  }
  std::vector<std::string> Command(const std::string& program, std::vector<std::string> arguments) const {
    std::vector<std::string> words = {std::string(MAPMEND_BIN_DIR) + "/" + program, "--lcm-url", url_, "--log-level",
                                      "warn"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return words;
  }
  // Waits until the viewer reports this state; handles the bus meanwhile.
  bool WaitForState(Bus* bus, const std::string& state) {
    viewer_state_.clear();
    const auto deadline = Clock::now() + std::chrono::seconds(30);
    while (viewer_state_ != state && Clock::now() < deadline) bus->Handle(50);
    return viewer_state_ == state;
  }
  static RecordBody Frame(int submap, int frame, int keyframe, double x) {
    MapUpdate update;
    update.submap = SubmapId(submap);
    update.frames.push_back(
        {frame, 1000000LL * frame, KeyframeId(keyframe), Rigid3(Eigen::Quaterniond::Identity(), {-x, 0, 0})});
    return update;
  }
  // Two submaps of three frames on a line; returns the last seq.
  int64_t SendFlight(Bus* bus) const {
    StreamSender sender(bus, kSession, {});
    SessionStarted start;
    start.source = "line.mp4";
    start.pinhole = {400, 400, 320, 240, 640, 480};
    start.camera.width = 640, start.camera.height = 480, start.camera.fx = start.camera.fy = 400;
    start.camera.cx = 320, start.camera.cy = 240;
    start.vocabulary_hash = "00";
    start.settings_json = "{}";
    sender.Append(0, start);
    for (int submap = 0; submap < 2; ++submap) {
      const int first = 4 * submap;
      sender.Append(1000000LL * first, SubmapStarted{SubmapId(submap)});
      KeyframeRecord keyframe;
      keyframe.submap = SubmapId(submap);
      keyframe.keyframe = KeyframeId(submap);
      keyframe.frame = first;
      sender.Append(1000000LL * first, keyframe);
      for (int k = 0; k < 3; ++k) sender.Append(1000000LL * (first + k), Frame(submap, first + k, submap, k));
      sender.Append(1000000LL * (first + 2), SubmapEnded{SubmapId(submap), submap == 0 ? "blur" : "end_of_input", "",
                                                         first + 2, 1000000LL * (first + 2)});
    }
    const int64_t last = sender.Append(7000000, SessionEnded{8});
    EXPECT_TRUE(sender.Flush(20000)) << sender.StoreError();
    return last;
  }
  // Submap 1 begins at x = 10 of submap 0 and its units are twice as long.
  static MapRevision FinalRevision(int64_t last_seq) {
    MapRevision revision;
    revision.transforms.revision = 1;
    revision.transforms.is_final = true;
    revision.transforms.cursors = {{kSession, last_seq}};
    for (int i = 0; i < 2; ++i) {
      const Similarity3 root_from_submap(1 + i, Eigen::Quaterniond::Identity(), {10.0 * i, 0, 0});
      revision.transforms.submaps.push_back({{kSession, SubmapId(i)}, 0, root_from_submap, i == 0});
    }
    return revision;
  }

  fs::path dir_;
  Hub hub_;
  std::string url_;
  std::atomic<bool> stop_ = false;
  std::thread hub_thread_;
  std::string viewer_state_;
};

TEST_F(ViewerExportTest, WritesTheExportsOfTheFinalRevisionWheneverItIsStarted) {
  Process store(Command("submap_store", {"--db", (dir_ / "map.db").string()}));
  Bus bus(url_, "");
  const Subscription subscription =
      bus.Subscribe<health_t>(channels::kHealth, Delivery::kKeepAll, [&](const health_t& health) {
        if (health.process == "viewer_export") viewer_state_ = health.state;
      });
  const auto check = [&](const std::string& out) {
    std::ifstream file(dir_ / out / "summary.json");
    const nlohmann::json summary = nlohmann::json::parse(file, nullptr, false);
    ASSERT_TRUE(summary.is_object()) << "no summary.json";
    EXPECT_EQ(summary["frames_in"], 8);
    EXPECT_EQ(summary["frames_in_main"], 6);
    EXPECT_EQ(summary["losses"], 1);
    std::ifstream frames(dir_ / out / "frames.tum");
    std::string line, last;
    while (std::getline(frames, line)) last = line;
    EXPECT_EQ(last.substr(0, 12), "6.000000 14 ") << "10 + 2 * 2";
    EXPECT_TRUE(fs::exists(dir_ / out / "report.html"));
  };
  {
    Process viewer(Command("viewer_export", {"--out", (dir_ / "live").string()}));
    ASSERT_TRUE(WaitForState(&bus, "ready"));
    Bus flight_bus(url_, "");
    const int64_t last = SendFlight(&flight_bus);
    ASSERT_TRUE(WaitForState(&bus, "busy"));
    EXPECT_FALSE(fs::exists(dir_ / "live/summary.json")) << "exported before the final revision";
    StoreClient client(&bus, "test");
    ASSERT_TRUE(client.StoreRevision(FinalRevision(last)));
    ASSERT_TRUE(WaitForState(&bus, "done"));
    check("live");
    EXPECT_EQ(viewer.Stop(), 0);
  }
  Process late(Command("viewer_export", {"--out", (dir_ / "late").string()}));
  ASSERT_TRUE(WaitForState(&bus, "done"));
  check("late");
}

}  // namespace viewer_export_test
}  // namespace mapmend
