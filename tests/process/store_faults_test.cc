// Kills of every process of the stream: nothing acknowledged is lost, nothing comes twice, and what is in the file at
// the end is what is there without any fault. MAPMEND_KILLS sets how many kills of the store are made (default 100).

#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <random>

#include "libs/bus/bus.h"
#include "libs/wire/codec.h"
#include "libs/wire/outbox.h"
#include "libs/wire/stream_sender.h"
#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"
#include "tests/process/store_helper.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace store_faults_test {

constexpr int kFinishMs = 900000;  // only what hangs takes longer, on a busy machine too

class StoreFaults : public ::testing::Test {
 protected:
  void SetUp() override {
    flight_.num_submaps = 4;
    flight_.keyframes_per_submap = 60;
    flight_.num_features = 300;
    flight_.points_per_keyframe = 100;
    progress_ = MapSharedProgress();
    port_ = AnyFreePort();
    hub_ = StartHub(port_, log_);
  }
  TestProcess Frontend(int pause_us) {
    return TestProcess([this, pause_us] { RunFrontend(flight_, port_, folder_.File("outbox"), pause_us, progress_); });
  }
  // Last record in the file, as another process sees it.
  int64_t CommittedSeq() {
    Database database(db_, Database::Mode::kReadOnly);
    const auto sessions = database.Sessions();
    return sessions.empty() ? -1 : sessions.front().cumulative;
  }
  void ExpectWholeFlight(TestProcess* store) {
    EXPECT_TRUE(PollUntil([&] { return store->Catches(SIGTERM); }, kFinishMs));
    EXPECT_EQ(store->Terminate(), 0);
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
  int port_ = 0;
  TestProcess hub_;
};

TEST_F(StoreFaults, SurvivesKillsOfTheStoreAtRandomMoments) {
  const char* setting = std::getenv("MAPMEND_KILLS");
  const int num_kills = setting == nullptr ? 100 : std::atoi(setting);
  std::mt19937 random(5);
  TestProcess store = StartStore(db_, port_, log_);
  TestProcess frontend = Frontend(20000);
  int num_with_progress = 0;
  for (int i = 0; i < num_kills; ++i) {
    const int64_t before = progress_->acknowledged;
    // Many hit a store that only begins; on a busy machine all would.
    if (i % 4 == 0) PollUntil([&] { return progress_->acknowledged > before || !frontend.IsRunning(); }, kFinishMs);
    PauseMs(20 + static_cast<int>(random() % 200));
    const int64_t acknowledged = progress_->acknowledged;
    store.Kill();
    if (acknowledged >= 0) {
      EXPECT_GE(CommittedSeq(), acknowledged) << "kill " << i;
    }
    if (acknowledged > before) ++num_with_progress;
    store = StartStore(db_, port_, log_);
  }
  EXPECT_GT(num_with_progress, num_kills / 10);  // the kills hit a store that was at work
  EXPECT_EQ(frontend.Wait(kFinishMs), 0);
  ExpectWholeFlight(&store);
}

TEST_F(StoreFaults, AnOutboxOfWhichTheStoreHasMoreIsDelivered) {
  // A vehicle that lost power: the store has had what the disk on board had not.
  TestProcess store = StartStore(db_, port_, log_);
  TestProcess frontend = Frontend(0);
  EXPECT_EQ(frontend.Wait(kFinishMs), 0);
  const std::vector<Record> records = MakeSyntheticStream(flight_);
  const std::string path = folder_.File("lost_its_end");
  {
    Outbox outbox(path, 1 << 20);
    for (size_t i = 0; i < records.size() / 2; ++i) outbox.Append(EncodeRecord(records[i]));
  }
  TestProcess deliver([&] {
    Bus bus(HubUrl(port_), "");
    if (!DeliverOutbox(&bus, path, 20000)) std::_Exit(1);
  });
  EXPECT_EQ(deliver.Wait(kFinishMs), 0);
  EXPECT_TRUE(Outbox(path).Empty());
  ExpectWholeFlight(&store);
}

TEST_F(StoreFaults, SurvivesKillsOfTheFrontend) {
  std::mt19937 random(6);
  TestProcess store = StartStore(db_, port_, log_);
  for (int i = 0; i < 10; ++i) {
    TestProcess frontend = Frontend(1000);
    if (i % 3 == 1) store.Signal(SIGSTOP);  // what it makes now is in its outbox only
    PauseMs(50 + static_cast<int>(random() % 150));
    const int64_t appended = progress_->appended;
    frontend.Kill();
    store.Signal(SIGCONT);
    // The next life takes over: nothing that was appended is made again, so all of it must have been in outbox or
    // store.
    progress_->acknowledged = -1;
    EXPECT_GE(progress_->appended, appended);
  }
  TestProcess frontend = Frontend(0);
  EXPECT_EQ(frontend.Wait(kFinishMs), 0);
  ExpectWholeFlight(&store);
}

TEST_F(StoreFaults, SurvivesKillsOfTheHub) {
  TestProcess store = StartStore(db_, port_, log_);
  TestProcess frontend = Frontend(2000);
  for (int i = 0; i < 5; ++i) {
    PauseMs(250);
    hub_.Kill();
    PauseMs(i == 2 ? 1500 : 50);
    hub_ = StartHub(port_, log_);
  }
  EXPECT_EQ(frontend.Wait(kFinishMs), 0);
  ExpectWholeFlight(&store);
}

TEST_F(StoreFaults, DeliversLaterWhatWasMadeWithoutAStore) {
  TestProcess frontend = Frontend(0);
  const int64_t last = 4 * (2 + 3 * 60) + 1;
  ASSERT_TRUE(PollUntil([&] { return progress_->appended == last; }, 30000));  // it did not wait for anybody
  EXPECT_EQ(progress_->acknowledged, -1);
  TestProcess store = StartStore(db_, port_, log_);
  EXPECT_EQ(frontend.Wait(kFinishMs), 0);
  ExpectWholeFlight(&store);
}

}  // namespace store_faults_test
}  // namespace mapmend
