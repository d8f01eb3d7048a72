#include "libs/wire/stream_sender.h"

#include <gtest/gtest.h>

#include "libs/wire/outbox.h"
#include "tests/fake_store.h"
#include "tests/running_hub.h"
#include "tests/scratch_folder.h"
#include "tests/synthetic_stream.h"

namespace mapmend {
namespace stream_sender_test {

constexpr char kFlight[] = "00000000-0000-4000-8000-000000000001";
constexpr int kLongMs = 30000;  // on any machine

bool PollUntil(const std::function<bool()>& done) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::milliseconds(kLongMs);
  while (!done() && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  return done();
}

class StreamSenderTest : public ::testing::Test {
 protected:
  StreamSenderTest() : records_(MakeSyntheticStream({.num_submaps = 1, .keyframes_per_submap = 4})) {
    options_.outbox_path = folder_.File("outbox");
    options_.resend_unasked_ms = 300;
  }
  void AppendAll(StreamSender* sender) {
    for (const Record& record : records_) sender->Append(record.header.utime, record.body);
  }
  int64_t Last() const { return static_cast<int64_t>(records_.size()) - 1; }
  // Whether the store has the flight as it was made.
  void ExpectStored(const FakeStore& store) {
    const auto stored = store.Records(kFlight);
    ASSERT_EQ(stored.size(), records_.size());
    for (const Record& record : records_) {
      EXPECT_EQ(stored.at(record.header.seq).data, EncodeRecord(record).data) << record.header.seq;
    }
  }

  ScratchFolder folder_;
  RunningHub hub_;
  Bus bus_{hub_.Url(), ""};
  StreamSenderOptions options_;
  std::vector<Record> records_;
};

TEST_F(StreamSenderTest, NumbersRecordsAndSendsThemInOrder) {
  FakeStore store(hub_.Url());
  StreamSender sender(&bus_, kFlight, options_);
  EXPECT_EQ(sender.LastSeq(), -1);
  EXPECT_EQ(sender.Append(records_[0].header.utime, records_[0].body), 0);
  EXPECT_EQ(sender.Append(records_[1].header.utime, records_[1].body), 1);
  for (size_t i = 2; i < records_.size(); ++i) sender.Append(records_[i].header.utime, records_[i].body);
  ASSERT_TRUE(sender.Flush(kLongMs));
  EXPECT_EQ(sender.AcknowledgedSeq(), Last());
  EXPECT_EQ(sender.StoreError(), "");
  ExpectStored(store);
}

TEST_F(StreamSenderTest, WhatIsLostOnTheWayIsSentAgain) {
  FakeStore store(hub_.Url());
  for (const int64_t seq : {int64_t{0}, int64_t{5}, Last()}) store.Lose(seq);
  StreamSender sender(&bus_, kFlight, options_);
  AppendAll(&sender);
  ASSERT_TRUE(sender.Flush(kLongMs));
  EXPECT_EQ(store.num_lost, 3);
  ExpectStored(store);
}

TEST_F(StreamSenderTest, ASilentStoreIsToldAndWhatItDidNotTakeIsKeptForTheNextLife) {
  {
    StreamSender sender(&bus_, kFlight, options_);
    AppendAll(&sender);
    EXPECT_FALSE(sender.Flush(50));
    EXPECT_EQ(sender.AcknowledgedSeq(), -1);
    EXPECT_TRUE(PollUntil([&] { return bus_.IsConnected(); }));
    EXPECT_EQ(sender.Obstacle(), "the submap store does not answer");
  }
  FakeStore store(hub_.Url());
  EXPECT_THROW(StreamSender(&bus_, "another", options_), std::runtime_error);
  EXPECT_TRUE(DeliverOutbox(&bus_, options_.outbox_path, kLongMs));
  ExpectStored(store);
  EXPECT_TRUE(DeliverOutbox(&bus_, options_.outbox_path, 0));  // nothing is left
}

TEST_F(StreamSenderTest, ANextLifeGoesOnWithTheNumbers) {
  FakeStore store(hub_.Url());
  {
    StreamSender sender(&bus_, kFlight, options_);
    for (size_t i = 0; i < 5; ++i) sender.Append(records_[i].header.utime, records_[i].body);
    ASSERT_TRUE(sender.Flush(kLongMs));
  }
  StreamSender sender(&bus_, kFlight, options_);
  EXPECT_EQ(sender.LastSeq(), 4);
  for (size_t i = 5; i < records_.size(); ++i) {
    EXPECT_EQ(sender.Append(records_[i].header.utime, records_[i].body), static_cast<int64_t>(i));
  }
  ASSERT_TRUE(sender.Flush(kLongMs));
  ExpectStored(store);
}

TEST_F(StreamSenderTest, GoesOnAfterWhatTheStoreHasIfTheOutboxIsGone) {
  FakeStore store(hub_.Url());
  for (int64_t seq = 0; seq < 5; ++seq) store.Put(EncodeRecord(records_[static_cast<size_t>(seq)]));
  StreamSender sender(&bus_, kFlight, options_);
  sender.ContinueAfter(4);
  EXPECT_EQ(sender.Append(records_[5].header.utime, records_[5].body), 5);
  EXPECT_THROW(sender.ContinueAfter(9), std::logic_error);
  for (size_t i = 6; i < records_.size(); ++i) sender.Append(records_[i].header.utime, records_[i].body);
  ASSERT_TRUE(sender.Flush(kLongMs));
  ExpectStored(store);
}

TEST_F(StreamSenderTest, TellsTheStoresError) {
  FakeStore store(hub_.Url());
  store.SetError("disk full");
  StreamSender sender(&bus_, kFlight, options_);
  AppendAll(&sender);
  ASSERT_TRUE(PollUntil([&] { return sender.StoreError() == "disk full"; }));
  EXPECT_EQ(sender.Obstacle(), "the submap store says: disk full");
  store.SetError("");
  ASSERT_TRUE(PollUntil([&] { return sender.StoreError().empty(); }));
  EXPECT_EQ(sender.Obstacle(), "the submap store is slow");
}

TEST_F(StreamSenderTest, WithoutAHubItSaysSo) {
  Bus nowhere("tcpq://127.0.0.1:1", "");
  options_.outbox_path.clear();
  StreamSender sender(&nowhere, kFlight, options_);
  sender.Append(records_[0].header.utime, records_[0].body);
  EXPECT_FALSE(sender.Flush(20));
  EXPECT_EQ(sender.Obstacle(), "no connection to the hub");
}

TEST_F(StreamSenderTest, RefusesWhatIsNoNameOfASession) {
  EXPECT_THROW(StreamSender(&bus_, "no name", options_), std::invalid_argument);
}

}  // namespace stream_sender_test
}  // namespace mapmend
