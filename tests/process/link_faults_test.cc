// What lies between a frontend and its store fails for a while: whoever makes records never waits, all of them arrive,
// and the file is that of a flight that nobody disturbed.

#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>

#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"
#include "tests/process/command_helper.h"
#include "tests/process/store_helper.h"
#include "tests/scratch_folder.h"
#include "tests/tcp_proxy.h"

namespace mapmend {
namespace link_faults_test {

constexpr int kOutageMs = 8000, kFinishMs = 900000;
constexpr double kMaxWaitMs = 2000;  // of one Append on a busy machine; the outages are much longer

class LinkFaults : public ::testing::Test {
 protected:
  void SetUp() override {
    flight_.num_submaps = 4;
    flight_.keyframes_per_submap = 60;
    flight_.num_features = 300;
    flight_.points_per_keyframe = 100;
    hub_port_ = AnyFreePort();
    hub_ = StartHub(hub_port_, log_);
    // In a process of its own, so that the test itself has no threads.
    struct Shared {
      TcpProxy::Control control;
      std::atomic<int> port{0};
    };
    auto* shared = MapShared<Shared>();
    control_ = &shared->control;
    proxy_ = TestProcess([this, shared] {
      TcpProxy proxy(hub_port_, &shared->control);
      shared->port = proxy.Port();
      for (;;) proxy.Spin(10);
    });
    ASSERT_TRUE(PollUntil([&] { return shared->port > 0; }, 30000));
    proxy_port_ = shared->port;
    progress_ = MapSharedProgress();
    store_ = StartStore(db_, hub_port_, log_);
  }
  // A frontend behind the proxy, with pauses that make its flight as long as the outages.
  void StartFlight() {
    frontend_ = TestProcess([this] { RunFrontend(flight_, proxy_port_, folder_.File("outbox"), 20000, progress_); });
    ASSERT_TRUE(PollUntil([&] { return progress_->acknowledged > 30; }, 60000));
  }
  // Waits while something is broken. The flight must go on.
  void SitOut() {
    const int64_t before = progress_->appended;
    PauseMs(kOutageMs);
    EXPECT_GT(progress_->appended, before + 50);
  }
  void ExpectWholeFlight() {
    EXPECT_EQ(frontend_.Wait(kFinishMs), 0);
    EXPECT_LT(progress_->longest_append_ms, kMaxWaitMs);
    EXPECT_EQ(store_.Terminate(), 0);
    const std::vector<std::string> problems = CheckDb(db_);
    EXPECT_TRUE(problems.empty()) << problems.front();
    Database database(db_, Database::Mode::kReadOnly);
    EXPECT_TRUE(database.Gaps(1).empty());
    EXPECT_EQ(HashDb(db_).stream, ExpectedStreamHash(flight_, folder_.File("expected.db")));
  }

  ScratchFolder folder_;
  std::string db_ = folder_.File("map.db"), log_ = folder_.File("log.txt");
  SyntheticStreamOptions flight_;
  SharedProgress* progress_ = nullptr;
  TcpProxy::Control* control_ = nullptr;
  int hub_port_ = 0, proxy_port_ = 0;
  TestProcess hub_, proxy_, store_, frontend_;
};

TEST_F(LinkFaults, ALinkThatIsCut) {
  StartFlight();
  control_->is_cut = true;
  SitOut();
  control_->is_cut = false;
  ExpectWholeFlight();
}

TEST_F(LinkFaults, AHubThatStops) {
  StartFlight();
  hub_.Signal(SIGSTOP);
  SitOut();
  hub_.Signal(SIGCONT);
  ExpectWholeFlight();
}

TEST_F(LinkFaults, AHubThatComesBackWithoutItsConnections) {
  StartFlight();
  control_->is_cut = true;  // its host is gone, nobody says goodbye
  hub_.Kill();
  SitOut();
  hub_ = StartHub(hub_port_, log_);
  control_->is_cut = false;
  ExpectWholeFlight();
}

TEST_F(LinkFaults, AStoreThatStops) {
  StartFlight();
  store_.Signal(SIGSTOP);
  SitOut();
  store_.Signal(SIGCONT);
  ExpectWholeFlight();
}

TEST_F(LinkFaults, ALongWayDoesNotMakeTheStreamLonger) {
  control_->delay_ms = 150;
  StartFlight();
  ExpectWholeFlight();
  int64_t stream_bytes = 0;
  Database database(db_, Database::Mode::kReadOnly);
  database.ReadRecords(database.Sessions().at(0), 0, 1 << 20, [&](const EncodedRecord& record) {
    stream_bytes += static_cast<int64_t>(record.data.size());
    return true;
  });
  EXPECT_LT(control_->bytes_up, stream_bytes * 3 / 2);
}

// A real frontend: it tracks on while the link is cut, waits for it at the end, and makes the same stream.
TEST_F(LinkFaults, ACameraIsTrackedOnWhileTheLinkIsCut) {
  const std::string flight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";
  const auto fly = [&](int port, const std::string& name) {
    return TestProcess(
        {ProgramPath("frontend"), flight + "video.mp4", "--camera", flight + "camera.yaml", "--vocabulary",
         std::string(MAPMEND_SOURCE_DIR) + "/data/vocabulary/mapmend.voc", "--skip-frames", "0-39,74-83,131-400",
         "--session", "s1", "--outbox", folder_.File(name), "--lcm-url", HubUrl(port)},
        folder_.File(name + ".txt"));
  };
  const auto outbox_bytes = [&](const std::string& name) {
    std::error_code error;
    const auto size = std::filesystem::file_size(folder_.File(name), error);
    return error ? int64_t{0} : static_cast<int64_t>(size);
  };
  TestProcess undisturbed = fly(hub_port_, "undisturbed");
  ASSERT_EQ(undisturbed.Wait(kFinishMs), 0) << ReadWholeFile(folder_.File("undisturbed.txt"));
  ASSERT_EQ(store_.Terminate(), 0);
  const std::string expected = HashDb(db_).stream;
  const std::string second_db = folder_.File("second.db");
  store_ = StartStore(second_db, hub_port_, log_);
  TestProcess frontend = fly(proxy_port_, "cut");
  ASSERT_TRUE(PollUntil([&] { return control_->bytes_up > 200000; }, 120000));
  control_->is_cut = true;
  // To the end of the flight and beyond: the frontend does not give up.
  int64_t last = -1;
  ASSERT_TRUE(PollUntil(
      [&] {
        const int64_t now = outbox_bytes("cut");
        const bool stands = now == last && now > 1000000;
        last = now;
        PauseMs(6000);
        return stands || !frontend.IsRunning();
      },
      kFinishMs));
  EXPECT_TRUE(frontend.IsRunning()) << ReadWholeFile(folder_.File("cut.txt"));
  control_->is_cut = false;
  EXPECT_EQ(frontend.Wait(kFinishMs), 0) << ReadWholeFile(folder_.File("cut.txt"));
  EXPECT_EQ(store_.Terminate(), 0);
  EXPECT_EQ(HashDb(second_db).stream, expected);
  EXPECT_LT(outbox_bytes("cut"), 1000);
}

}  // namespace link_faults_test
}  // namespace mapmend
