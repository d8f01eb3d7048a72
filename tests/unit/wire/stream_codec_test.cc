#include "libs/wire/stream_codec.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <mapmend/ack_t.hpp>
#include <mapmend/frame_pose_t.hpp>
#include <mapmend/health_t.hpp>
#include <mapmend/record_checksum_t.hpp>

#include "libs/bus/health.h"
#include "tests/unit/wire/random_values.h"

namespace mapmend {
namespace stream_codec_test {

FramePose RandomFramePose(RandomValues* random) {
  return {{random->Session(), SubmapId(random->Int(-1, 99))},
          random->Seq(),
          random->Int(-1, 1 << 30),
          random->Text(),
          random->Pose(),
          random->Int(0, 999)};
}

Health RandomHealth(RandomValues* random) {
  Health health;
  health.process = random->Text();
  health.pid = random->Int(1, 1 << 22);
  health.host = random->Text();
  health.version = random->Text();
  health.utime = random->Seq();
  health.state = random->Text();
  health.message = random->Text();
  for (int i = random->Int(0, 4); i > 0; --i) health.cursors[random->Session()] = random->Seq();
  health.queue_depth = random->Int(0, 1000);
  health.cpu_s = random->Positive();
  health.rss_mb = random->Positive();
  health.peak_rss_mb = random->Positive();
  for (int i = random->Int(0, 9); i > 0; --i) health.counters[random->Text()] = random->Real();
  return health;
}

TEST(StreamCodec, WhatIsEncodedComesBack) {
  RandomValues random(1);
  for (int i = 0; i < 300; ++i) {
    ExpectBack(StreamState{random.Text(), random.Seq(), random.Seq(), random.Seq(), random.Bool()});
    ExpectBack(
        StreamAck{random.Text(), random.Seq(), random.List<int64_t>(20, [&] { return random.Seq(); }), random.Text()});
    ExpectBack(StoreStarted{random.Seq()});
    ExpectBack(RecordChecksumList{random.Session(), random.Int(0, 1 << 30), random.List<uint32_t>(8, [&] {
                                    return static_cast<uint32_t>(random.Int(0, std::numeric_limits<int>::max())) * 2u;
                                  })});
    ExpectBack(RandomFramePose(&random));
    ExpectBack(RandomHealth(&random));
  }
}

// The layout of lcmtypes/ack_t.lcm and health_t.lcm, which other programs read.
TEST(StreamCodec, EveryFieldIsWhereItsMessageHasIt) {
  ack_t ack{};
  const auto data = Encode(StreamAck{"s", 41, {7, 9}, "disk full"});
  ASSERT_TRUE(DecodeMessage(data.data(), static_cast<int>(data.size()), &ack));
  EXPECT_EQ(ack.cumulative, 41);
  EXPECT_EQ(ack.missing, (std::vector<int64_t>{7, 9}));
  EXPECT_EQ(ack.error, "disk full");
  Health health;
  health.process = "merger";
  health.pid = 12;
  health.host = "air";
  health.counters["connections"] = 3;
  health.cursors["s"] = 8;
  health_t message{};
  const auto bytes = Encode(health);
  ASSERT_TRUE(DecodeMessage(bytes.data(), static_cast<int>(bytes.size()), &message));
  EXPECT_EQ(message.process, "merger");
  EXPECT_EQ(message.pid, 12);
  EXPECT_EQ(message.host, "air");
  ASSERT_EQ(message.num_counters, 1);
  EXPECT_EQ(message.counters[0].name, "connections");
  EXPECT_EQ(message.counters[0].value, 3);
  ASSERT_EQ(message.num_cursors, 1);
  EXPECT_EQ(message.cursors[0].seq, 8);
}

TEST(StreamCodec, RefusesChecksumsOfNoRecord) {
  record_checksum_t message{};
  message.session = "s";
  message.num_records = 1;
  message.crc32 = {-1};
  const auto decode = [&] { return Decode<RecordChecksumList>(EncodeMessage(message)); };
  ASSERT_TRUE(decode().value);
  EXPECT_EQ(decode().value->crc32[0], 0xffffffffu);
  message.first_seq = -1;
  EXPECT_FALSE(decode().value);
  message.first_seq = std::numeric_limits<int64_t>::max();
  EXPECT_FALSE(decode().value);
  message.first_seq = 0;
  message.session = "../s";
  EXPECT_FALSE(decode().value);
}

TEST(StreamCodec, APoseThatIsNotFiniteIsNotTracked) {
  frame_pose_t message{};
  message.session = "s";
  message.submap = 2;
  message.frame = 5;
  message.state = "tracking";
  message.cam_from_submap[6] = 1;
  EXPECT_EQ(Decode<FramePose>(EncodeMessage(message)).value->submap.submap, SubmapId(2));
  message.cam_from_submap[1] = std::numeric_limits<double>::infinity();
  const auto pose = Decode<FramePose>(EncodeMessage(message)).value;
  ASSERT_TRUE(pose);
  EXPECT_FALSE(pose->submap.submap.IsValid());
  EXPECT_EQ(pose->frame, 5);
  EXPECT_TRUE(pose->cam_from_submap.translation.allFinite());
}

TEST(StreamCodec, TheErrorNamesTheMessage) {
  EXPECT_EQ(Decode<StreamAck>(std::vector<uint8_t>{1, 2, 3}).error, "not a ack_t");
  EXPECT_EQ(Decode<Health>(Encode(StreamAck())).error, "not a health_t");
}

}  // namespace stream_codec_test
}  // namespace mapmend
