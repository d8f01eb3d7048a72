#include "libs/wire/stream_consumer.h"

#include <gtest/gtest.h>

#include "tests/fake_store.h"
#include "tests/running_hub.h"
#include "tests/synthetic_stream.h"

namespace mapmend {
namespace stream_consumer_test {

constexpr char kFlight[] = "00000000-0000-4000-8000-000000000001";

class StreamConsumerTest : public ::testing::Test {
 protected:
  StreamConsumerTest() : records_(MakeSyntheticStream({.num_submaps = 2, .keyframes_per_submap = 4})) {
    for (const Record& record : records_) encoded_.push_back(EncodeRecord(record));
  }
  bool SpinUntil(const std::function<bool()>& done) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!done() && std::chrono::steady_clock::now() < deadline) consumer_.Spin(5);
    return done();
  }
  bool HasDelivered(size_t number) {
    return SpinUntil([&] { return delivered_.size() >= number; });
  }
  void PublishLive(size_t from, size_t to) {
    for (size_t i = from; i < to; ++i) {
      ASSERT_TRUE(
          bus_.PublishRaw(encoded_[i].channel, encoded_[i].data.data(), static_cast<int>(encoded_[i].data.size())));
    }
  }

  std::vector<Record> records_;
  std::vector<EncodedRecord> encoded_;
  RunningHub hub_;
  FakeStore store_{hub_.Url()};
  Bus bus_{hub_.Url(), ""};
  StoreClient client_{&bus_, "test"};
  std::vector<int64_t> delivered_;
  StreamConsumer consumer_{&bus_, &client_, [this](const Record& record) { delivered_.push_back(record.header.seq); }};
};

std::vector<int64_t> UpTo(size_t number) {
  std::vector<int64_t> all(number);
  for (size_t i = 0; i < number; ++i) all[i] = static_cast<int64_t>(i);
  return all;
}

TEST_F(StreamConsumerTest, WhatTheStoreHasComesOnceAndInOrder) {
  for (const EncodedRecord& record : encoded_) store_.Put(record);
  ASSERT_TRUE(HasDelivered(records_.size()));
  EXPECT_EQ(delivered_, UpTo(records_.size()));
  ASSERT_EQ(consumer_.Cursors().size(), 1u);
  EXPECT_EQ(consumer_.Cursors()[0].session, kFlight);
  EXPECT_EQ(consumer_.Cursors()[0].seq, static_cast<int64_t>(records_.size()) - 1);
  EXPECT_TRUE(consumer_.Cursors()[0].ended);
  EXPECT_EQ(consumer_.QueueDepth(), 0);
  EXPECT_EQ(consumer_.NumRefused(), 0);
}

TEST_F(StreamConsumerTest, GoesOnWithWhatIsHeardLive) {
  for (size_t i = 0; i < 6; ++i) store_.Put(encoded_[i]);
  ASSERT_TRUE(HasDelivered(6));
  PublishLive(6, records_.size());  // to the store as well, which acknowledges
  ASSERT_TRUE(HasDelivered(records_.size()));
  EXPECT_EQ(delivered_, UpTo(records_.size()));
}

TEST_F(StreamConsumerTest, NothingIsDeliveredBeforeTheStoreHasIt) {
  for (size_t i = 0; i < 6; ++i) store_.Put(encoded_[i]);
  ASSERT_TRUE(HasDelivered(6));
  store_.Lose(6);
  PublishLive(6, records_.size());
  EXPECT_TRUE(SpinUntil([&] { return store_.num_lost == 1; }));
  for (int i = 0; i < 20; ++i) consumer_.Spin(5);
  EXPECT_EQ(delivered_, UpTo(6));
  store_.Put(encoded_[6]);
  ASSERT_TRUE(HasDelivered(records_.size()));
  EXPECT_EQ(delivered_, UpTo(records_.size()));
}

TEST_F(StreamConsumerTest, AHoleThatTheStoreHasGivenUpIsSkipped) {
  for (size_t i = 0; i < encoded_.size(); ++i) {
    if (i != 4) store_.Put(encoded_[i]);
  }
  store_.GiveUp(kFlight, 4);
  ASSERT_TRUE(HasDelivered(records_.size() - 1));
  std::vector<int64_t> expected = UpTo(records_.size());
  expected.erase(expected.begin() + 4);
  EXPECT_EQ(delivered_, expected);
}

TEST_F(StreamConsumerTest, ARecordThatDoesNotDecodeIsCountedAndLeftOut) {
  for (const EncodedRecord& record : encoded_) store_.Put(record);
  EncodedRecord damaged = encoded_[3];
  damaged.data.resize(damaged.data.size() - 5);
  store_.Put(damaged);
  EncodedRecord misplaced = encoded_[7];
  misplaced.seq = 5;
  store_.Put(misplaced);
  ASSERT_TRUE(HasDelivered(records_.size() - 2));
  EXPECT_EQ(consumer_.NumRefused(), 2);
  const uint8_t noise[] = {1, 2, 3};
  ASSERT_TRUE(bus_.PublishRaw(channels::kKeyframe, noise, 3));
  EXPECT_TRUE(SpinUntil([&] { return consumer_.NumRefused() == 3; }));
}

TEST_F(StreamConsumerTest, ASilentStoreIsWaitedFor) {
  for (const EncodedRecord& record : encoded_) store_.Put(record);
  store_.is_silent = true;
  consumer_.Spin(5);
  EXPECT_TRUE(delivered_.empty());
  store_.is_silent = false;
  EXPECT_TRUE(HasDelivered(records_.size()));
}

TEST_F(StreamConsumerTest, ASessionThatTheStoreHasTakenUpAgainIsAnError) {
  for (const EncodedRecord& record : encoded_) store_.Put(record);
  ASSERT_TRUE(HasDelivered(records_.size()));
  store_.Erase(kFlight, 10);
  EXPECT_THROW(SpinUntil([] { return false; }), std::runtime_error);
}

}  // namespace stream_consumer_test
}  // namespace mapmend
