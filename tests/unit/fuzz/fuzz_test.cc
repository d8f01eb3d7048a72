#include <gtest/gtest.h>

#include <mapmend/all_types.hpp>
#include <random>

#include "libs/bus/bus.h"
#include "libs/bus/health.h"
#include "libs/wire/codec.h"
#include "libs/wire/image_codec.h"
#include "libs/wire/query_codec.h"
#include "libs/wire/revision_codec.h"
#include "libs/wire/stream_codec.h"
#include "tests/mutate_message.h"
#include "tests/synthetic_stream.h"

// Every message type, decoded from 100,000 damaged messages each: no crash, no read or write outside, no allocation
// beyond the message's own size, and what is accepted is exactly what a sender could have sent.
namespace mapmend {
namespace fuzz_test {

constexpr int kMutations = 100000;

template <typename Message>
void FuzzType(unsigned seed) {
  SCOPED_TRACE(Message::getTypeName());
  std::mt19937 random(seed);
  // Accepted messages of new sizes join the corpus: so arrays come to be filled.
  std::vector<std::vector<uint8_t>> corpus = {EncodeMessage(Message{})};
  int64_t num_accepted = 0;
  for (int i = 0; i < kMutations; ++i) {
    const std::vector<uint8_t> data = MutateMessage(corpus[random() % corpus.size()], &random);
    Message message{};
    if (!DecodeMessage(data.data(), static_cast<int>(data.size()), &message)) continue;
    ++num_accepted;
    ASSERT_EQ(message.getEncodedSize(), static_cast<int>(data.size()));
    const bool is_new_size =
        std::none_of(corpus.begin(), corpus.end(), [&](const auto& x) { return x.size() == data.size(); });
    if (is_new_size && data.size() < 2000 && corpus.size() < 200) corpus.push_back(data);
  }
  EXPECT_GT(num_accepted, 0);
}

TEST(Fuzz, EveryTypeDecodesOrIsRefused) {
  unsigned seed = 1;
#define FUZZ_TYPE(type) FuzzType<type>(++seed);
  MAPMEND_LCM_TYPES(FUZZ_TYPE)
#undef FUZZ_TYPE
}

// What a codec accepts can be sent on, and is then the same; what it refuses has a reason.
template <typename Value>
void FuzzCodec(const Value& value) {
  constexpr int kMutationsOfValue = 20000;
  const std::vector<uint8_t> original = Encode(value);
  std::mt19937 random(5);
  int num_accepted = 0, num_refused = 0;
  for (int i = 0; i < kMutationsOfValue; ++i) {
    const Decoded<Value> decoded = Decode<Value>(MutateMessage(original, &random));
    ASSERT_NE(decoded.value.has_value(), !decoded.error.empty());
    ++(decoded.value ? num_accepted : num_refused);
    if (!decoded.value) continue;
    const std::vector<uint8_t> sent_on = Encode(*decoded.value);
    const Decoded<Value> again = Decode<Value>(sent_on);
    ASSERT_TRUE(again.value) << again.error;
    ASSERT_EQ(Encode(*again.value), sent_on);
  }
  EXPECT_GT(num_accepted, 100);
  EXPECT_GT(num_refused, 1000);
}

TEST(Fuzz, RevisionsAreValidOrRefusedWithAReason) {
  EvaluatedConnection connection;
  connection.a = {"s", SubmapId(0)};
  connection.b = {"s", SubmapId(1)};
  connection.verdict = EvaluatedConnection::Verdict::kAccepted;
  connection.pairs = {{KeyframeId(1), KeyframeId(2), 30}};
  MergedTransforms transforms;
  transforms.cursors = {{"s", 40}};
  transforms.submaps = {{connection.a, 0, {}, true}, {connection.b, 0, {}, false}};
  transforms.edges = {{0, 1}};
  FuzzCodec(connection);
  FuzzCodec(transforms);
  FuzzCodec(RevisionHead{transforms, {connection}, 1});
  FuzzCodec(RevisionPart{
      3, 0, {connection.b, {{KeyframeId(3), {}, 2}}, {{MapPointId(9), {4, 5, 6}}}, {{MapPointId(8), "s", {}}}}});
  FuzzCodec(GraphReply{{7, "edges"}, transforms, 1, {connection}});
}

TEST(Fuzz, QuestionsAndAnswersAreValidOrRefusedWithAReason) {
  FuzzCodec(BowQuery{{1, "merger"}, {"s", KeyframeId(4), {{"s", 40}}, 20, false}});
  BowAnswer answer;
  answer.proposals = {{"s", SubmapId(0), KeyframeId(4), 0.5f, 0.25f, 30}};
  FuzzCodec(answer);
  FetchAnswer fetched;
  fetched.session = "s";
  fetched.records = {{"s", 3, "MAPMEND_KEYFRAME", {1, 2, 3}}, {"s", 4, "MAPMEND_SUBMAP", {4, 5}}};
  fetched.sessions = {{"s", 4}};
  FuzzCodec(fetched);
  FuzzCodec(EdgeRequest{{1, "edges"}, {{{"s", SubmapId(0)}, {"s", SubmapId(1)}, true}}});
  FuzzCodec(RevisionAnswer{{1, "viewer"}, RevisionAnswer::Status::kOk, 5, 0, 2, {1, 2, 3}});
}

TEST(Fuzz, WhatIsSaidBesideTheStreamIsValidOrRefusedWithAReason) {
  FuzzCodec(StreamState{"s", 0, 7, 0, false});
  FuzzCodec(StreamAck{"s", 7, {3, 4}, ""});
  FuzzCodec(RecordChecksumList{"s", 0, {1, 2}});
  FuzzCodec(FramePose{{"s", SubmapId(0)}, 0, 3, "tracking", {}, 40});
  Health health;
  health.process = "merger";
  health.cursors["s"] = 7;
  health.counters["connections"] = 3;
  FuzzCodec(health);
}

TEST(Fuzz, ImagesAreValidOrRefusedWithAReason) {
  KeyframeImage image;
  image.session = std::string("s");
  image.keyframe = KeyframeId(4);
  image.frame = 12;
  image.width = 800;
  image.height = 600;
  image.encoding = std::string("jpeg");
  image.bytes = {1, 2, 3, 4, 5};
  FuzzCodec(ImagePiece{image, 9, 77, 2});
  FuzzCodec(ImageAnswer{{1, "viewer"}, ImageAnswer::Status::kOk, image});
  FuzzCodec(ImageRequest{"s", {{KeyframeId(4), 12, 0}, {KeyframeId(3), 9, 5}}, {KeyframeId(1)}});
  FuzzCodec(ImageStatus{{1, "viewer"}, "s", 3, 1, 0, {{KeyframeId(4), 12}}});
}

TEST(Fuzz, RecordsAreValidOrRefusedWithAReason) {
  SyntheticStreamOptions options;
  options.num_submaps = 1;
  options.keyframes_per_submap = 2;
  options.num_features = 12;
  options.points_per_keyframe = 8;
  options.num_words = 10;
  std::vector<EncodedRecord> corpus;
  for (const Record& record : MakeSyntheticStream(options)) corpus.push_back(EncodeRecord(record));
  WideFeaturesRecord wide;
  wide.submap = SubmapId(0);
  wide.keyframe = KeyframeId(1);
  wide.features.keypoints.resize(5);
  wide.features.descriptors.resize(5);
  corpus.push_back(EncodeRecord({{options.session, 20, 1}, wide}));
  std::mt19937 random(7);
  int num_accepted = 0, num_refused = 0;
  for (int i = 0; i < kMutations; ++i) {
    const EncodedRecord& original = corpus[random() % corpus.size()];
    const std::vector<uint8_t> data = MutateMessage(original.data, &random);
    const DecodedRecord decoded = DecodeRecord(original.channel, data.data(), static_cast<int>(data.size()));
    ASSERT_NE(decoded.record.has_value(), !decoded.error.empty());
    if (!decoded.record) {
      ++num_refused;
      continue;
    }
    ++num_accepted;
    ASSERT_GE(decoded.record->header.seq, 0);
    ASSERT_TRUE(IsSessionId(decoded.record->header.session));
    const auto* keyframe = std::get_if<KeyframeRecord>(&decoded.record->body);
    if (keyframe == nullptr) continue;
    ASSERT_TRUE(keyframe->cam_from_submap.translation.allFinite());
    ASSERT_EQ(keyframe->map_points.size(), keyframe->features.descriptors.size());
    for (const Keypoint& keypoint : keyframe->features.keypoints) ASSERT_TRUE(keypoint.pixel.allFinite());
    for (const float weight : keyframe->bow.weights) ASSERT_TRUE(weight > 0);
  }
  EXPECT_GT(num_accepted, 1000);
  EXPECT_GT(num_refused, 10000);
}

}  // namespace fuzz_test
}  // namespace mapmend
