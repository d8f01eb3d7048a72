#include "procs/submap_store/session_log.h"

#include <gtest/gtest.h>

#include "tests/synthetic_stream.h"

namespace mapmend {
namespace session_log_test {

class SessionLogTest : public ::testing::Test {
 protected:
  static std::vector<Record> SmallFlight() {
    SyntheticStreamOptions options;
    options.session = "s";
    options.num_submaps = 1;
    options.keyframes_per_submap = 3;
    options.num_features = 12;
    options.points_per_keyframe = 10;
    options.num_words = 10;
    return MakeSyntheticStream(options);
  }
  // Record 0 starts the session, 1 the submap; 3, 6 and 9 are keyframes; 11 ends the submap, 12 the session.
  SessionLog::Offered Offer(size_t seq) { return log_.Offer(EncodeRecord(flight_.at(seq)), now_ms_); }
  SessionLog::Offered OfferDamaged(size_t seq) {
    EncodedRecord damaged = EncodeRecord(flight_.at(seq));
    damaged.data.resize(damaged.data.size() - 4);
    return log_.Offer(damaged, now_ms_);
  }
  void Heartbeat(int64_t first, int64_t last) { log_.OnHeartbeat({"s", first, last, 0, false}, now_ms_); }
  // What is ready, in short: "0 1 gap 2-3 4".
  static std::string Describe(const std::vector<LogItem>& items) {
    std::string text;
    for (const LogItem& item : items) {
      if (!text.empty()) text += " ";
      if (const auto* gap = std::get_if<LogGap>(&item)) {
        text += "gap " + std::to_string(gap->first_seq) + "-" + std::to_string(gap->last_seq);
      } else {
        text += std::to_string(std::get<LogEntry>(item).encoded.seq);
      }
    }
    return text;
  }
  std::string Take() {
    const std::string text = Describe(log_.TakeReady(now_ms_));
    log_.Committed();
    return text;
  }

  const std::vector<Record> flight_ = SmallFlight();
  SessionLog log_{"s", {}};
  int64_t now_ms_ = 1000000;
};

TEST_F(SessionLogTest, HandsRecordsOutOnceAndInOrder) {
  for (const size_t seq : {3, 0, 2, 5}) EXPECT_EQ(Offer(seq), SessionLog::Offered::kPending) << seq;
  EXPECT_EQ(Offer(2), SessionLog::Offered::kDuplicate);
  EXPECT_EQ(Take(), "0");
  EXPECT_EQ(Take(), "");
  Offer(1);
  EXPECT_EQ(Take(), "1 2 3");
  EXPECT_EQ(Offer(1), SessionLog::Offered::kDuplicate);
  EXPECT_EQ(log_.QueueDepth(), 1);
}

TEST_F(SessionLogTest, AcknowledgesWhatIsCommittedAndNamesTheHoles) {
  for (const size_t seq : {0, 1, 3}) Offer(seq);
  Heartbeat(0, 5);
  log_.TakeReady(now_ms_);
  EXPECT_EQ(log_.MakeAck("").cumulative, -1) << "handed out, but not committed";
  log_.Committed();
  EXPECT_EQ(log_.MakeAck(""), (StreamAck{"s", 1, {2, 4, 5}, ""}));
  const StreamAck full = log_.MakeAck("disk full");
  EXPECT_EQ(full.error, "disk full");
  EXPECT_TRUE(full.missing.empty()) << "a store that cannot write asks for nothing";
}

TEST_F(SessionLogTest, AHoleIsAGapOnceItsSenderNoLongerHasIt) {
  for (const size_t seq : {0, 1, 2, 4}) Offer(seq);
  now_ms_ += 3600000;
  Heartbeat(3, 4);
  EXPECT_EQ(Take(), "0 1 2") << "it is asked for as long as the sender has it";
  Heartbeat(4, 4);
  EXPECT_EQ(Take(), "gap 3-3 gap 4-4") << "4 moves the keyframe that 3 brought";
  EXPECT_EQ(log_.MakeAck("").missing, (std::vector<int64_t>{4, 3}));
}

TEST_F(SessionLogTest, InARecordingAHoleIsAGapAfterAWhile) {
  SessionLogOptions options;
  options.is_recording = true;
  log_ = SessionLog("s", options);
  for (const size_t seq : {0, 1, 3}) Offer(seq);
  Heartbeat(3, 3);  // what the recorded frontend could still send then says nothing
  EXPECT_EQ(Take(), "0 1");
  now_ms_ += options.settle_ms;
  EXPECT_EQ(Take(), "");
  now_ms_ += 1;
  EXPECT_EQ(Take(), "gap 2-2 gap 3-3") << "3 needs the points that 2 brought";
  EXPECT_FALSE(log_.IsAlive(now_ms_));
}

TEST_F(SessionLogTest, ARecordThatNeverDecodesBecomesAGap) {
  for (const size_t seq : {0, 1}) Offer(seq);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(OfferDamaged(2), SessionLog::Offered::kRefused);
  EXPECT_EQ(Take(), "0 1") << "it may come whole yet";
  OfferDamaged(2);
  EXPECT_EQ(Take(), "gap 2-2");
  EXPECT_EQ(log_.NumRefused(), 1);
}

TEST_F(SessionLogTest, ADamagedRecordThatComesWholeIsTaken) {
  for (const size_t seq : {0, 1}) Offer(seq);
  for (int i = 0; i < 3; ++i) OfferDamaged(2);
  Offer(2);
  EXPECT_EQ(Take(), "0 1 2");
}

TEST_F(SessionLogTest, WithoutItsFirstRecordNothingIsTakenUntilThatComes) {
  for (int i = 0; i < 3; ++i) OfferDamaged(0);
  EXPECT_EQ(Take(), "");
  EXPECT_NE(log_.MakeAck("").error.find("its first record is refused"), std::string::npos) << log_.Error();
  EXPECT_EQ(Offer(1), SessionLog::Offered::kRefused);
  EXPECT_EQ(Offer(0), SessionLog::Offered::kPending);
  EXPECT_EQ(Take(), "0");
  EXPECT_EQ(log_.MakeAck("").error, "");
}

TEST_F(SessionLogTest, AKeyframeWhoseIdDoesNotGrowIsRefused) {
  for (const size_t seq : {0, 1, 2, 3, 4, 5}) Offer(seq);
  Record again = flight_[6];
  std::get<KeyframeRecord>(again.body).keyframe = std::get<KeyframeRecord>(flight_[3].body).keyframe;
  log_.Offer(EncodeRecord(again), now_ms_);
  const std::vector<LogItem> items = log_.TakeReady(now_ms_);
  EXPECT_EQ(Describe(items), "0 1 2 3 4 5 gap 6-6");
  EXPECT_NE(std::get<LogGap>(items.back()).reason.find("does not grow"), std::string::npos);
}

TEST_F(SessionLogTest, WhatIsFarAheadOrTooMuchIsSentAgainLater) {
  SessionLogOptions options;
  options.max_ahead = 5;
  options.max_pending_bytes = static_cast<int64_t>(EncodeRecord(flight_[3]).data.size());
  log_ = SessionLog("s", options);
  EXPECT_EQ(Offer(5), SessionLog::Offered::kRefused) << "six ahead";
  EXPECT_EQ(Offer(3), SessionLog::Offered::kPending);
  EXPECT_EQ(Offer(4), SessionLog::Offered::kRefused) << "no room";
  EXPECT_EQ(Offer(0), SessionLog::Offered::kPending) << "for the next one there is always room";
}

TEST_F(SessionLogTest, AForgedHeartbeatSaysNothing) {
  Offer(0);
  EXPECT_EQ(Take(), "0");
  const std::pair<int64_t, int64_t> forged[] = {{0, -2}, {-1, 3}, {5, 3}, {0, int64_t{1} << 40}};
  for (const auto& [first, last] : forged) Heartbeat(first, last);
  EXPECT_EQ(log_.NumRefused(), 4);
  EXPECT_FALSE(log_.IsAlive(now_ms_));
  EXPECT_TRUE(log_.MakeAck("").missing.empty());
  Heartbeat(0, 1);
  EXPECT_TRUE(log_.IsAlive(now_ms_));
  EXPECT_FALSE(log_.IsAlive(now_ms_ + 2001));
}

TEST_F(SessionLogTest, ClosingEndsWhatIsOpenAndIsNotAcknowledgedToTheFrontend) {
  for (const size_t seq : {0, 1, 2, 3, 4}) Offer(seq);
  Heartbeat(0, 6);
  Take();
  const std::vector<LogItem> items = log_.TakeClosing();
  log_.Committed();
  EXPECT_EQ(Describe(items), "gap 5-6 7 8");
  ASSERT_EQ(items.size(), 3u);
  EXPECT_EQ(std::get<LogGap>(items[0]).reason, kClosedReason);
  const auto& end = std::get<SubmapEnded>(std::get<LogEntry>(items[1]).record.body);
  EXPECT_EQ(end.reason, "interrupted");
  EXPECT_TRUE(std::holds_alternative<SessionEnded>(std::get<LogEntry>(items[2]).record.body));
  EXPECT_TRUE(log_.Ended());
  EXPECT_EQ(log_.ClosedFrom(), 5);
  EXPECT_EQ(log_.Cumulative(), 8);
  EXPECT_EQ(log_.MakeAck("").cumulative, 4) << "the frontend must not forget what it still has";
  EXPECT_TRUE(log_.TakeClosing().empty()) << "it has ended";
}

}  // namespace session_log_test
}  // namespace mapmend
