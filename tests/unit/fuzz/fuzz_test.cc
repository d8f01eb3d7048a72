#include <gtest/gtest.h>

#include <mapmend/all_types.hpp>
#include <random>

#include "libs/bus/bus.h"
#include "libs/wire/codec.h"
#include "tests/mutate_message.h"
#include "tests/synthetic_stream.h"

// Every message type, decoded from 100,000 damaged messages each: no crash, no read or write outside, no allocation
// beyond the message's own size, and what is accepted is exactly what a sender could have sent.
namespace mapmend {
namespace {

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

TEST(Fuzz, RecordsAreValidOrRefusedWithAReason) {
  SyntheticStreamOptions options;
  options.num_submaps = 1;
  options.keyframes_per_submap = 2;
  options.num_features = 12;
  options.points_per_keyframe = 8;
  options.num_words = 10;
  std::vector<EncodedRecord> corpus;
  for (const Record& record : MakeSyntheticStream(options)) corpus.push_back(EncodeRecord(record));
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

}  // namespace
}  // namespace mapmend
