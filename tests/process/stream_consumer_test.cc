// What merger and viewer rely on: every committed record once and in order, whatever dies meanwhile; requests over the
// real hub.

#include "libs/wire/stream_consumer.h"

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <csignal>

#include "libs/wire/codec.h"
#include "libs/wire/store_client.h"
#include "procs/submap_store/database.h"
#include "tests/process/store_helper.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace stream_consumer_test {

class StreamConsumerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    flight_.num_submaps = 2;
    flight_.keyframes_per_submap = 30;
    progress_ = MapSharedProgress();
    port_ = AnyFreePort();
    hub_ = StartHub(port_, log_);
    store_ = StartStore(db_, port_, log_);
    Connect();
  }
  // As a consumer process that starts.
  void Connect() {
    consumer_.reset();
    client_.reset();
    bus_ = std::make_unique<Bus>(HubUrl(port_), "");
    client_ = std::make_unique<StoreClient>(bus_.get(), "test-" + std::to_string(++num_consumers_));
    delivered_.clear();
    consumer_ = std::make_unique<StreamConsumer>(bus_.get(), client_.get(), [this](const Record& record) {
      // Once, in order, and all.
      if (!may_have_holes_) {
        EXPECT_EQ(record.header.seq, static_cast<int64_t>(delivered_.size()));
      }
      delivered_.push_back(EncodeRecord(record).data);
    });
  }
  bool SpinUntil(const std::function<bool()>& done, int timeout_ms = 60000) {
    return PollUntil(
        [&] {
          consumer_->Spin(5);
          return done();
        },
        timeout_ms);
  }
  bool HasEnded() {
    const auto cursors = consumer_->Cursors();
    return cursors.size() == 1 && cursors[0].ended;
  }
  void ExpectWholeFlight() {
    const std::vector<Record> records = MakeSyntheticStream(flight_);
    ASSERT_EQ(delivered_.size(), records.size());
    for (size_t i = 0; i < records.size(); ++i) {
      ASSERT_EQ(delivered_[i].size(), EncodeRecord(records[i]).data.size()) << i;
    }
  }

  ScratchFolder folder_;
  std::string db_ = folder_.File("map.db"), log_ = folder_.File("log.txt");
  SyntheticStreamOptions flight_;
  SharedProgress* progress_ = nullptr;
  int port_ = 0, num_consumers_ = 0;
  bool may_have_holes_ = false;
  TestProcess hub_, store_;
  std::unique_ptr<Bus> bus_;
  std::unique_ptr<StoreClient> client_;
  std::unique_ptr<StreamConsumer> consumer_;
  std::vector<std::vector<uint8_t>> delivered_;
};

TEST_F(StreamConsumerTest, DeliversEverythingOnceWhateverDiesMeanwhile) {
  TestProcess frontend([this] { RunFrontend(flight_, port_, folder_.File("outbox"), 10000, progress_); });
  ASSERT_TRUE(SpinUntil([&] { return delivered_.size() > 20; }));
  store_.Kill();
  SpinUntil([] { return false; }, 200);
  store_ = StartStore(db_, port_, log_);
  ASSERT_TRUE(SpinUntil([&] { return delivered_.size() > 60; }));
  hub_.Kill();
  SpinUntil([] { return false; }, 200);
  hub_ = StartHub(port_, log_);
  ASSERT_TRUE(SpinUntil([&] { return HasEnded(); }));
  ExpectWholeFlight();
  const auto live = delivered_;
  Connect();  // one that comes late gets the same from the store
  ASSERT_TRUE(SpinUntil([&] { return HasEnded(); }));
  EXPECT_EQ(delivered_, live);
  EXPECT_EQ(frontend.Wait(60000), 0);
}

TEST_F(StreamConsumerTest, DeliversNothingThatTheStoreDoesNotHave) {
  ASSERT_TRUE(SpinUntil([&] { return bus_->IsConnected(); }, 5000));
  TestProcess frontend([this] { RunFrontend(flight_, port_, folder_.File("outbox"), 5000, progress_); });
  ASSERT_TRUE(SpinUntil([&] { return delivered_.size() > 10; }));
  store_.Kill();
  SpinUntil([] { return false; }, 500);  // the frontend goes on, and is heard
  Database database(db_, Database::Mode::kReadOnly);
  EXPECT_LE(static_cast<int64_t>(delivered_.size()) - 1, database.Sessions()[0].cumulative);
  EXPECT_GT(progress_->appended, database.Sessions()[0].cumulative);
}

TEST_F(StreamConsumerTest, ASessionOfADeadFrontendCanBeClosed) {
  TestProcess frontend([this] { RunFrontend(flight_, port_, folder_.File("outbox"), 50000, progress_); });
  ASSERT_TRUE(SpinUntil([&] { return delivered_.size() > 20; }));
  const auto alive = client_->CloseSession(flight_.session, 1500);
  ASSERT_TRUE(alive);
  EXPECT_EQ(alive->status, CloseAnswer::Status::kStillAlive);
  frontend.Kill();
  may_have_holes_ = true;
  const auto closed = client_->CloseSession(flight_.session, 20000);
  ASSERT_TRUE(closed);
  EXPECT_EQ(closed->status, CloseAnswer::Status::kOk);
  EXPECT_TRUE(SpinUntil([&] { return HasEnded(); }, 10000));
  EXPECT_LE(static_cast<int64_t>(delivered_.size()), closed->cumulative + 1);  // less what was on its way
}

TEST_F(StreamConsumerTest, WhoHasSeenTheEndOfASessionThatGoesOnMustStartAfresh) {
  // Slow, so that on a busy machine too the flight is not over before it is stopped.
  TestProcess frontend([this] { RunFrontend(flight_, port_, folder_.File("outbox"), 100000, progress_); });
  ASSERT_TRUE(SpinUntil([&] { return delivered_.size() > 20; }));
  frontend.Signal(SIGSTOP);  // as one whose link is cut
  may_have_holes_ = true;    // what is on its way just now
  const auto closed = client_->CloseSession(flight_.session, 20000);
  ASSERT_TRUE(closed);
  ASSERT_EQ(closed->status, CloseAnswer::Status::kOk);
  ASSERT_TRUE(SpinUntil([&] { return HasEnded(); }, 20000));
  frontend.Signal(SIGCONT);
  EXPECT_THROW(SpinUntil([] { return false; }, 30000), std::runtime_error) << ReadWholeFile(log_);
  may_have_holes_ = false;
  Connect();
  ASSERT_TRUE(SpinUntil([&] { return HasEnded(); }));
  ExpectWholeFlight();
  EXPECT_EQ(frontend.Wait(10000), 0);
}

TEST_F(StreamConsumerTest, RevisionsAreStoredAndReadBackByThoseWhoComeLater) {
  EXPECT_EQ(client_->FetchRevision(-1, 5000).status, StoreClient::RevisionStatus::kNone);
  MapRevision revision;
  revision.transforms.revision = 5;
  revision.transforms.is_final = true;
  for (int i = 0; i < 20; ++i)
    revision.refined.push_back({{"a", SubmapId(i)}, {}, {{MapPointId(i), {1, 2, static_cast<float>(i)}}}, {}});
  ASSERT_TRUE(client_->StoreRevision(revision, 10000));
  store_.Kill();
  store_ = StartStore(db_, port_, log_);
  Connect();
  const StoreClient::FetchedRevision found = client_->FetchRevision(-1, 10000);
  ASSERT_EQ(found.status, StoreClient::RevisionStatus::kOk);
  EXPECT_EQ(found.revision, revision);
}

}  // namespace stream_consumer_test
}  // namespace mapmend
