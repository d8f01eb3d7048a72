// What the store says of a flight whose frontend is gone: the frames that it was to map up to the last one that came.

#include <gtest/gtest.h>

#include <algorithm>

#include "procs/submap_store/database.h"
#include "procs/submap_store/submap_store.h"
#include "tests/scratch_folder.h"
#include "tests/synthetic_stream.h"

namespace mapmend {
namespace closed_session_test {

class ClosedSession : public ::testing::Test {
 protected:
  void Open() {
    store_.reset();
    SubmapStoreOptions options;
    options.path = path_;
    store_ = std::make_unique<SubmapStore>(options);
  }
  // The first records of a flight that leaves out frames 0 and 1; returns its last frame.
  int Fly(size_t num_records) {
    Open();
    std::vector<Record> records = MakeSyntheticStream(options_);
    std::get<SessionStarted>(records[0].body).settings_json = R"({"skip_frames": "0-1"})";
    records.resize(std::min(num_records, records.size() - 1));
    int last_frame = -1;
    for (const Record& record : records) {
      const EncodedRecord encoded = EncodeRecord(record);
      store_->OnRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()), 1000);
      if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body))
        last_frame = std::max(last_frame, keyframe->frame);
      if (const auto* update = std::get_if<MapUpdate>(&record.body)) {
        for (const TrackedFrame& frame : update->frames) last_frame = std::max(last_frame, frame.frame);
      }
    }
    store_->CommitReady(1000);
    while (store_->WorkInBackground()) continue;
    return last_frame;
  }
  int FramesRead() {
    EXPECT_EQ(store_->Close({Addressed(), options_.session}, 1000000).status, CloseAnswer::Status::kOk);
    store_.reset();
    Database database(path_, Database::Mode::kReadOnly);
    auto query = database.Prepare("SELECT num_frames FROM session");
    return query->executeStep() ? query->getColumn(0).getInt() : -1;
  }

  ScratchFolder folder_;
  const std::string path_ = folder_.File("map.db");
  SyntheticStreamOptions options_;
  std::unique_ptr<SubmapStore> store_;
};

TEST_F(ClosedSession, CountsTheFramesThatWereWanted) {
  const int last_frame = Fly(20);
  ASSERT_GT(last_frame, 3);
  EXPECT_EQ(FramesRead(), last_frame + 1 - 2);
}

TEST_F(ClosedSession, KnowsThemAfterARestart) {
  const int last_frame = Fly(20);
  Open();
  EXPECT_EQ(FramesRead(), last_frame + 1 - 2);
}

TEST_F(ClosedSession, KnowsThemIfEverySubmapHadEnded) {
  const int last_frame = Fly(1000);
  Open();
  EXPECT_EQ(FramesRead(), last_frame + 1 - 2);
}

TEST_F(ClosedSession, OfAFlightWithoutASubmapThereAreNone) {
  Fly(1);
  Open();
  EXPECT_EQ(FramesRead(), 0);
}

}  // namespace closed_session_test
}  // namespace mapmend
