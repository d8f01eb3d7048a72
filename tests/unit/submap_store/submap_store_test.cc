#include "procs/submap_store/submap_store.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "libs/wire/codec.h"
#include "libs/wire/query_codec.h"
#include "libs/wire/stream_codec.h"
#include "procs/submap_store/db_commands.h"
#include "tests/mutate_message.h"
#include "tests/scratch_folder.h"
#include "tests/synthetic_stream.h"

namespace mapmend {
namespace submap_store_test {

class SubmapStoreTest : public ::testing::Test {
 protected:
  void Open(bool is_recording = false) {
    store_.reset();
    SubmapStoreOptions options;
    options.path = folder_.File("map.db");
    options.log.is_recording = is_recording;
    store_ = std::make_unique<SubmapStore>(options);
  }
  void Offer(const Record& record) { OfferEncoded(EncodeRecord(record)); }
  void OfferEncoded(const EncodedRecord& encoded) {
    store_->OnRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()), now_ms_);
  }
  // utime: the frontend's clock, which may be anything.
  void Heartbeat(int64_t first, int64_t last, int64_t utime = 0) {
    store_->OnHeartbeat({options_.session, first, last, utime, false}, now_ms_);
  }
  void Commit() {
    store_->CommitReady(now_ms_);
    while (store_->WorkInBackground()) continue;
  }
  BowQuery QueryAsOf(KeyframeId keyframe, int64_t seq) {
    BowQuery query;
    query.session = options_.session;
    query.keyframe = keyframe;
    query.cursors = {{options_.session, seq}};
    return query;
  }
  int64_t Cumulative() { return store_->Ack(options_.session).cumulative; }
  std::vector<int64_t> Missing() { return store_->Ack(options_.session).missing; }

  ScratchFolder folder_;
  SyntheticStreamOptions options_;
  std::unique_ptr<SubmapStore> store_;
  int64_t now_ms_ = 1000000;
};

TEST_F(SubmapStoreTest, AcknowledgesOnlyWhatIsCommitted) {
  Open();
  const auto records = MakeSyntheticStream(options_);
  Offer(records[0]);
  EXPECT_EQ(Cumulative(), -1);
  Commit();
  EXPECT_EQ(Cumulative(), 0);
}

TEST_F(SubmapStoreTest, PutsRecordsInOrderAndNamesTheHoles) {
  Open();
  const auto records = MakeSyntheticStream(options_);
  for (const int seq : {0, 5, 1, 3}) Offer(records[static_cast<size_t>(seq)]);
  Heartbeat(0, 7);
  Commit();
  EXPECT_EQ(Cumulative(), 1);
  EXPECT_EQ(Missing(), (std::vector<int64_t>{2, 4, 6, 7}));
  for (const int seq : {4, 2, 6, 7}) Offer(records[static_cast<size_t>(seq)]);
  Commit();
  EXPECT_EQ(Cumulative(), 7);
  EXPECT_TRUE(Missing().empty());
}

TEST_F(SubmapStoreTest, IsIdempotentAcrossRestarts) {
  const auto records = MakeSyntheticStream(options_);
  const size_t half = records.size() / 2;
  Open();
  for (size_t i = 0; i < half; ++i) Offer(records[i]);
  Commit();
  Open();
  EXPECT_EQ(store_->GetStatus(now_ms_).records, static_cast<int64_t>(half));
  for (const Record& record : records) Offer(record);
  Commit();
  EXPECT_EQ(Cumulative(), static_cast<int64_t>(records.size()) - 1);
  const auto status = store_->GetStatus(now_ms_);
  EXPECT_EQ(status.records, static_cast<int64_t>(records.size()));
  EXPECT_EQ(status.duplicates, static_cast<int64_t>(half));
  EXPECT_EQ(status.refused, 0);
  EXPECT_EQ(status.open_sessions, 0);
  store_.reset();
  EXPECT_TRUE(CheckDb(folder_.File("map.db")).empty());
}

TEST_F(SubmapStoreTest, FetchReturnsWhatWasPublishedInBoundedReplies) {
  Open();
  const auto records = MakeSyntheticStream(options_);
  for (const Record& record : records) Offer(record);
  Commit();
  std::vector<std::vector<uint8_t>> fetched;
  FetchRequest request{Addressed(), options_.session, 0, 1000, 20000};
  while (fetched.size() < records.size()) {
    request.first_seq = static_cast<int64_t>(fetched.size());
    const FetchAnswer answer = store_->Fetch(request);
    ASSERT_EQ(answer.status, FetchAnswer::Status::kOk);
    ASSERT_FALSE(answer.records.empty());
    EXPECT_TRUE(answer.ended);
    size_t num_bytes = 0;
    for (const EncodedRecord& record : answer.records) {
      EXPECT_EQ(record.seq, static_cast<int64_t>(fetched.size()));
      EXPECT_EQ(record.session, options_.session);
      fetched.push_back(record.data);
      num_bytes += record.data.size();
    }
    EXPECT_TRUE(answer.records.size() == 1 || num_bytes <= 20000);
  }
  for (size_t i = 0; i < records.size(); ++i) EXPECT_EQ(fetched[i], EncodeRecord(records[i]).data);
  const FetchAnswer list = store_->Fetch(FetchRequest{});
  ASSERT_EQ(list.sessions.size(), 1u);
  EXPECT_EQ(list.sessions[0].seq, static_cast<int64_t>(records.size()) - 1);
}

// They may come when their submap has ended, also to a store that was started again since; they are kept and given out
// as they came, and the file is in order.
TEST_F(SubmapStoreTest, KeepsWideFeaturesOfSubmapsThatHaveEnded) {
  Open();
  std::vector<Record> records = MakeSyntheticStream(options_);
  Record end = records.back();
  records.pop_back();
  for (const Record& record : records) Offer(record);
  Commit();
  Open();
  for (int i = 0; i < 2; ++i) {
    WideFeaturesRecord wide;
    wide.submap = SubmapId(i);
    wide.keyframe = KeyframeId(10 * i + 1);
    wide.features.keypoints.resize(7, {{3, 4}, 20, 9});
    wide.features.descriptors.resize(7);
    wide.features.descriptors[2].fill(5);
    Record record;
    record.header = {options_.session, static_cast<int64_t>(records.size()), 5};
    record.body = wide;
    records.push_back(record);
    Offer(records.back());
  }
  end.header.seq = static_cast<int64_t>(records.size());
  records.push_back(end);
  Offer(end);
  Commit();
  EXPECT_EQ(Cumulative(), static_cast<int64_t>(records.size()) - 1);
  EXPECT_EQ(store_->GetStatus(now_ms_).refused, 0);
  const int64_t seq = static_cast<int64_t>(records.size()) - 2;
  const FetchAnswer answer = store_->Fetch(FetchRequest{Addressed(), options_.session, seq, seq, 1});
  ASSERT_EQ(answer.records.size(), 1u);
  EXPECT_EQ(answer.records[0].channel, "MAPMEND_WIDE_FEATURES");
  EXPECT_EQ(answer.records[0].data, EncodeRecord(records[records.size() - 2]).data);
  store_.reset();
  const std::vector<std::string> problems = CheckDb(folder_.File("map.db"));
  EXPECT_TRUE(problems.empty()) << problems.front();
}

TEST_F(SubmapStoreTest, RefusesBadRecordsAndGoesOn) {
  Open();
  auto records = MakeSyntheticStream(options_);
  // Record 3 is the first keyframe, 4 changes it.
  std::get<MapUpdate>(records[4].body).observations.push_back({KeyframeId(77), 0, MapPointId(0)});
  for (const Record& record : records) Offer(record);
  const uint8_t garbage[20] = {};
  store_->OnRecord("MAPMEND_KEYFRAME", garbage, 20, now_ms_);
  Commit();
  EXPECT_EQ(Cumulative(), static_cast<int64_t>(records.size()) - 1);
  EXPECT_EQ(store_->GetStatus(now_ms_).refused, 2);
  EXPECT_EQ(store_->GetStatus(now_ms_).gaps, 1);
  EXPECT_EQ(Missing(), std::vector<int64_t>{4});
  store_.reset();
  EXPECT_TRUE(CheckDb(folder_.File("map.db")).empty());
}

TEST_F(SubmapStoreTest, CountsAnotherRecordUnderACommittedNumber) {
  Open();
  auto records = MakeSyntheticStream(options_);
  for (int i = 0; i < 4; ++i) Offer(records[static_cast<size_t>(i)]);
  Commit();
  std::get<KeyframeRecord>(records[3].body).frame = 99;
  Offer(records[3]);
  Commit();
  EXPECT_EQ(store_->GetStatus(now_ms_).refused, 1);
  EXPECT_EQ(Cumulative(), 3);
}

TEST_F(SubmapStoreTest, RefusesASessionOfAnotherVocabulary) {
  Open();
  Offer(MakeSyntheticStream(options_)[0]);
  Commit();
  SyntheticStreamOptions other = options_;
  other.session = "other";
  other.vocabulary_hash = "0badcafe";
  Offer(MakeSyntheticStream(other)[0]);
  Commit();
  EXPECT_EQ(store_->Ack("other").cumulative, -1);
  EXPECT_NE(store_->Ack("other").error.find("uses vocabulary 0badcafe"), std::string::npos);
  EXPECT_NE(store_->GetStatus(now_ms_).error.find("vocabulary"), std::string::npos);
  store_.reset();
  SubmapStoreOptions options;
  options.path = folder_.File("map.db");
  options.vocabulary_hash = "0badcafe";
  EXPECT_THROW(SubmapStore{options}, std::runtime_error);
}

TEST_F(SubmapStoreTest, WaitsForAMissingRecordAsLongAsItsSenderHasItWhateverTheClocksSay) {
  Open();
  const auto records = MakeSyntheticStream(options_);
  for (const int seq : {0, 1, 3, 4}) Offer(records[static_cast<size_t>(seq)]);
  constexpr int64_t kHourUs = 3600000000;
  int64_t utime = 1700000000000000;
  for (int i = 0; i < 100; ++i) {
    now_ms_ += i % 10 == 9 ? 60000 : 1000;  // also after long silences
    utime += i % 3 == 0 ? -kHourUs : kHourUs;
    Heartbeat(i < 50 ? 0 : 2, 4, utime);
    Commit();
    ASSERT_EQ(Cumulative(), 1) << i;
  }
  Offer(records[2]);
  Commit();
  EXPECT_EQ(Cumulative(), 4);
  EXPECT_EQ(store_->GetStatus(now_ms_).gaps, 0);
}

TEST_F(SubmapStoreTest, GivesUpWhatItsSenderNoLongerHas) {
  Open();
  const auto records = MakeSyntheticStream(options_);
  for (const int seq : {0, 1, 3, 4}) Offer(records[static_cast<size_t>(seq)]);
  Heartbeat(3, 4);
  Commit();
  EXPECT_EQ(Cumulative(), 4);
  EXPECT_EQ(store_->GetStatus(now_ms_).gaps, 3);  // 2, and 3 and 4 that need what it brought
}

TEST_F(SubmapStoreTest, GivesUpWhatIsMissingInARecordingWhoseSenderCannotAnswer) {
  Open(true);
  const auto records = MakeSyntheticStream(options_);
  for (const int seq : {0, 1, 3, 4}) Offer(records[static_cast<size_t>(seq)]);
  for (int i = 0; i < 4; ++i) {
    now_ms_ += 1000;
    Heartbeat(0, 4);
    Commit();
  }
  EXPECT_EQ(Cumulative(), 4);
  EXPECT_EQ(store_->GetStatus(now_ms_).gaps, 3);
}

TEST_F(SubmapStoreTest, SaysWhyItTakesNothingOfASession) {
  Open();
  EncodedRecord first = EncodeRecord(MakeSyntheticStream(options_)[0]);
  first.data.resize(first.data.size() - 4);
  for (int i = 0; i < 3; ++i) OfferEncoded(first);
  Heartbeat(0, 5);
  Commit();
  EXPECT_NE(store_->Ack(options_.session).error.find("its first record is refused"), std::string::npos);
  Offer(MakeSyntheticStream(options_)[0]);  // a good one heals it
  Commit();
  EXPECT_EQ(store_->Ack(options_.session).error, "");
  EXPECT_EQ(Cumulative(), 0);
}

// The link to the frontend was down, or its host: whoever waited closed the session; then the rest comes after all.
TEST_F(SubmapStoreTest, TakesUpAClosedSessionAgainWhenItsFrontendHasMore) {
  const auto records = MakeSyntheticStream(options_);
  // What came before the close, what was heard of then: within a submap, and between two.
  const std::pair<size_t, int64_t> cases[] = {{10, 9}, {10, 14}, {33, 32}};
  for (const auto& [num_before, last_heard_of] : cases) {
    std::filesystem::remove(folder_.File("map.db"));
    Open();
    for (size_t i = 0; i < num_before; ++i) Offer(records[i]);
    Heartbeat(0, last_heard_of);
    Commit();
    now_ms_ += 5000;
    const CloseRequest request{Addressed(), options_.session};
    ASSERT_EQ(store_->Close(request, now_ms_).status, CloseAnswer::Status::kOk);
    Open();
    Heartbeat(static_cast<int64_t>(num_before) - 3, static_cast<int64_t>(num_before) - 1);  // it knows less than we do
    EXPECT_FALSE(store_->MustReload());
    EXPECT_EQ(Cumulative(), static_cast<int64_t>(num_before) - 1);  // the frontend must not forget what we made up
    if (num_before == 10) {
      Heartbeat(static_cast<int64_t>(num_before) - 3, static_cast<int64_t>(records.size()) - 1);
    } else {
      Offer(records[num_before]);
    }
    ASSERT_TRUE(store_->MustReload());
    Open();
    EXPECT_EQ(Cumulative(), static_cast<int64_t>(num_before) - 1);
    EXPECT_EQ(store_->GetStatus(now_ms_).open_sessions, 1);
    for (size_t i = num_before - 3; i < records.size(); ++i) Offer(records[i]);
    Commit();
    EXPECT_EQ(store_->GetStatus(now_ms_).gaps, 0);
    EXPECT_EQ(store_->GetStatus(now_ms_).open_sessions, 0);
    store_.reset();
    const std::vector<std::string> problems = CheckDb(folder_.File("map.db"));
    EXPECT_TRUE(problems.empty()) << problems.front();
    const std::string hash = HashDb(folder_.File("map.db")).stream;

    std::filesystem::remove(folder_.File("map.db"));
    Open();
    for (const Record& record : records) Offer(record);
    Commit();
    store_.reset();
    EXPECT_EQ(HashDb(folder_.File("map.db")).stream, hash);
  }
}

TEST_F(SubmapStoreTest, ClosesASessionWhoseFrontendDied) {
  Open();
  const auto records = MakeSyntheticStream(options_);
  for (size_t i = 0; i < 10; ++i) Offer(records[i]);
  Heartbeat(0, 9);
  Commit();
  const CloseRequest request{Addressed(), options_.session};
  EXPECT_EQ(store_->Close(request, now_ms_).status, CloseAnswer::Status::kStillAlive);
  now_ms_ += 5000;
  EXPECT_EQ(store_->GetStatus(now_ms_).silent_sessions, 1);
  const CloseAnswer reply = store_->Close(request, now_ms_);
  EXPECT_EQ(reply.status, CloseAnswer::Status::kOk);
  EXPECT_EQ(reply.cumulative, 11);  // submap ended, session ended
  EXPECT_EQ(store_->GetStatus(now_ms_).open_sessions, 0);
  EXPECT_EQ(store_->Close(request, now_ms_).cumulative, 11);  // again is harmless
  store_.reset();
  EXPECT_TRUE(CheckDb(folder_.File("map.db")).empty());
}

TEST_F(SubmapStoreTest, TellsHowFarASessionHasCome) {
  const auto records = MakeSyntheticStream(options_);
  const ProgressRequest request{Addressed(), options_.session};
  Open();
  EXPECT_EQ(store_->Progress(request).status, SessionProgress::Status::kUnknownSession);
  // What the answer must be after each record, from the records themselves.
  int32_t next_submap = 0, next_keyframe = 0, last_point = -1, open = -1, last_frame = -1;
  for (size_t i = 0; i < records.size(); ++i) {
    const RecordBody& body = records[i].body;
    if (const auto* start = std::get_if<SubmapStarted>(&body)) next_submap = (open = start->submap.value) + 1;
    if (std::holds_alternative<SubmapEnded>(body)) open = -1;
    if (const auto* keyframe = std::get_if<KeyframeRecord>(&body)) {
      next_keyframe = keyframe->keyframe.value + 1;
      last_frame = std::max(last_frame, keyframe->frame);
    }
    if (const auto* update = std::get_if<MapUpdate>(&body)) {
      for (const PointPosition& point : update->points) last_point = std::max(last_point, point.point.value);
      for (const TrackedFrame& frame : update->frames) last_frame = std::max(last_frame, frame.frame);
    }
    Offer(records[i]);
    Commit();
    if (i % 7 == 0) Open();  // the same after a restart
    const SessionProgress progress = store_->Progress(request);
    ASSERT_EQ(progress.status, SessionProgress::Status::kOk);
    EXPECT_EQ(progress.cumulative, static_cast<int64_t>(i));
    EXPECT_EQ(progress.ended, i + 1 == records.size());
    EXPECT_EQ(progress.next_submap, next_submap);
    EXPECT_EQ(progress.next_keyframe, next_keyframe);
    EXPECT_GT(progress.next_point, last_point);
    EXPECT_EQ(progress.open_submap.value, open);
    EXPECT_EQ(progress.last_frame, last_frame);
    EXPECT_GE(progress.last_utime, records[0].header.utime);
  }
}

TEST_F(SubmapStoreTest, ARemovedFileIsWrittenAnewAndAReplacedOneIsSavedBeside) {
  const auto records = MakeSyntheticStream(options_);
  const std::string path = folder_.File("map.db");
  Open();
  for (size_t i = 0; i < 10; ++i) Offer(records[i]);
  Commit();
  EXPECT_NO_THROW(store_->CheckPlace());
  std::filesystem::remove(path);
  try {
    store_->CheckPlace();
    FAIL() << "not noticed";
  } catch (const FileGone& e) {
    EXPECT_TRUE(e.can_go_on) << e.what();
  }
  Open();
  EXPECT_EQ(store_->GetStatus(now_ms_).records, 10);
  EXPECT_NO_THROW(store_->CheckPlace());

  std::filesystem::rename(path, path + ".away");
  std::ofstream(path) << "something else";
  try {
    store_->CheckPlace();
    FAIL() << "not noticed";
  } catch (const FileGone& e) {
    EXPECT_FALSE(e.can_go_on);
  }
  EXPECT_EQ(std::filesystem::file_size(path), 14u);
  store_.reset();
  EXPECT_TRUE(CheckDb(path + ".rescued").empty());
}

TEST_F(SubmapStoreTest, QueryFindsTheSamePlaceInAnotherSubmap) {
  Open();
  const auto records = MakeSyntheticStream(options_);
  for (const Record& record : records) Offer(record);
  Commit();
  const BowQuery query = QueryAsOf(KeyframeId(14), static_cast<int64_t>(records.size()) - 1);  // the fifth of submap 1
  const BowAnswer result = store_->Query(query);
  ASSERT_EQ(result.status, BowAnswer::Status::kOk);
  EXPECT_EQ(result.adjacent, KeyframeId(13));
  EXPECT_GE(result.nearby, KeyframeId(10));
  EXPECT_GT(result.n0, result.n1);
  EXPECT_NEAR(result.k, static_cast<float>(result.n1) / static_cast<float>(result.n0), 1e-6);
  EXPECT_NEAR(result.l, result.s1 / result.s0, 1e-5);
  ASSERT_GE(result.proposals.size(), 1u);
  EXPECT_EQ(result.proposals[0].submap, SubmapId(0));
  EXPECT_EQ(result.proposals[0].keyframe, KeyframeId(4));
}

// Whoever can reach the bus can send anything. The store goes on, what it stores fits together, and honest requests are
// answered.
TEST_F(SubmapStoreTest, DamagedMessagesOfAllKindsDoNoHarm) {
  Open();
  options_.num_features = 20;
  options_.points_per_keyframe = 15;
  options_.num_words = 20;
  const auto records = MakeSyntheticStream(options_);
  std::mt19937 random(3);
  // What arrives of a message that is damaged on its way; nothing if it is refused.
  const auto mutated = [&]<typename Message>(const Message& message) {
    return Decode<Message>(MutateMessage(Encode(message), &random)).value;
  };
  BowQuery query = QueryAsOf(KeyframeId(), -1);
  FetchRequest fetch{Addressed(), options_.session, 0, 100, 1000};
  StreamState state{options_.session, 0, -1, 0, false};
  for (size_t i = 0; i < records.size(); ++i) {
    for (int k = 0; k < 30; ++k) {
      const EncodedRecord encoded = EncodeRecord(records[random() % records.size()]);
      const std::vector<uint8_t> data = MutateMessage(encoded.data, &random);
      store_->OnRecord(encoded.channel, data.data(), static_cast<int>(data.size()), now_ms_);
    }
    Offer(records[i]);
    state.last = static_cast<int64_t>(i);
    state.utime = 1000000 * now_ms_;
    if (const auto bad = mutated(state)) store_->OnHeartbeat(*bad, now_ms_);
    query.cursors[0].seq = static_cast<int64_t>(i);
    query.keyframe = KeyframeId(static_cast<int>(i / 3));
    if (const auto bad = mutated(query)) store_->Query(*bad);
    if (const auto bad = mutated(fetch)) store_->Fetch(*bad);
    if (const auto bad = mutated(RevisionRequest{})) store_->revisions()->Fetch(*bad);
    Commit();
  }
  EXPECT_GE(Cumulative(), static_cast<int64_t>(records.size()) - 1);
  EXPECT_GT(store_->GetStatus(now_ms_).refused, 100);
  fetch.first_seq = 0;
  EXPECT_EQ(store_->Fetch(fetch).status, FetchAnswer::Status::kOk);
  store_.reset();
  const auto problems = CheckDb(folder_.File("map.db"));
  EXPECT_TRUE(problems.empty()) << problems.front();
}

// A restarted merger asks again what it asked before; the store has gone on meanwhile.
TEST_F(SubmapStoreTest, QueryAnswersAsOfTheCursorWhateverCameLater) {
  const auto records = MakeSyntheticStream(options_);
  Open();
  std::vector<BowAnswer> live;
  std::vector<BowQuery> queries;
  for (const Record& record : records) {
    Offer(record);
    store_->CommitReady(now_ms_);
    const auto* keyframe = std::get_if<KeyframeRecord>(&record.body);
    if (keyframe == nullptr) continue;
    queries.push_back(QueryAsOf(keyframe->keyframe, record.header.seq));
    live.push_back(store_->Query(queries.back()));
  }
  Commit();
  for (size_t i = 0; i < queries.size(); ++i) EXPECT_TRUE(store_->Query(queries[i]) == live[i]);
  Open();
  for (size_t i = queries.size(); i-- > 0;) {
    EXPECT_TRUE(store_->Query(queries[i]) == live[i]) << "keyframe " << queries[i].keyframe.value;
  }
}

TEST_F(SubmapStoreTest, QueryBeyondWhatIsCommittedIsNotAnsweredYet) {
  Open();
  const auto records = MakeSyntheticStream(options_);
  for (int i = 0; i < 4; ++i) Offer(records[static_cast<size_t>(i)]);
  Commit();
  BowQuery query = QueryAsOf(KeyframeId(0), 4);
  EXPECT_EQ(store_->Query(query).status, BowAnswer::Status::kNotYet);
  query.cursors[0].seq = 3;
  EXPECT_EQ(store_->Query(query).status, BowAnswer::Status::kOk);
  query.keyframe = KeyframeId(5);
  EXPECT_EQ(store_->Query(query).status, BowAnswer::Status::kUnknownKeyframe);
  query.cursors.clear();
  EXPECT_EQ(store_->Query(query).status, BowAnswer::Status::kBadQuery);
}

}  // namespace submap_store_test
}  // namespace mapmend
