#include "libs/wire/codec.h"

#include <gtest/gtest.h>

#include <limits>
#include <mapmend/keyframe_t.hpp>
#include <mapmend/map_update_t.hpp>
#include <mapmend/wide_features_t.hpp>
#include <random>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/retrieval/inverted_index.h"
#include "tests/synthetic_stream.h"

namespace mapmend {
namespace codec_test {

SyntheticStreamOptions SmallFlight() {
  SyntheticStreamOptions options;
  options.num_submaps = 1;
  options.keyframes_per_submap = 2;
  return options;
}

std::string DecodeError(const EncodedRecord& encoded) {
  return DecodeRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size())).error;
}

// The keyframe record of a small flight after change was made to its message.
std::string ErrorOfChangedKeyframe(const std::function<void(keyframe_t*)>& change) {
  EncodedRecord encoded = EncodeRecord(MakeSyntheticStream(SmallFlight())[3]);
  keyframe_t message{};
  EXPECT_TRUE(DecodeMessage(encoded.data.data(), static_cast<int>(encoded.data.size()), &message));
  change(&message);
  encoded.data = EncodeMessage(message);
  return DecodeError(encoded);
}

TEST(Codec, EveryRecordComesBackAsItWas) {
  for (const Record& record : MakeSyntheticStream(SmallFlight())) {
    const EncodedRecord encoded = EncodeRecord(record);
    const DecodedRecord decoded =
        DecodeRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()));
    ASSERT_TRUE(decoded.record) << decoded.error;
    EXPECT_EQ(decoded.record->body.index(), record.body.index());
    EXPECT_EQ(decoded.record->header.seq, record.header.seq);
    EXPECT_EQ(EncodeRecord(*decoded.record).data, encoded.data);
  }
}

TEST(Codec, EveryLensModelComesBack) {
  const Record record = MakeSyntheticStream(SmallFlight())[0];
  for (const char* name : {"pinhole", "fisheye", "rational", "fov", "omni", "double_sphere", "extended_unified",
                           "thin_prism_fisheye", "division"}) {
    Record changed = record;
    Camera& camera = std::get<SessionStarted>(changed.body).camera;
    ASSERT_TRUE(ParseCameraModel(name, &camera.model)) << name;
    for (int i = 0; i < camera.NumCoefficients(); ++i) camera.distortion[i] = 0.01 * (i + 1);
    const EncodedRecord encoded = EncodeRecord(changed);
    const DecodedRecord decoded =
        DecodeRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()));
    ASSERT_TRUE(decoded.record) << name << ": " << decoded.error;
    const Camera& back = std::get<SessionStarted>(decoded.record->body).camera;
    EXPECT_EQ(back.ModelName(), name);
    EXPECT_EQ(back.distortion, camera.distortion) << name;
  }
}

// A rotation that was normalised once is not always one that normalising leaves alone.
TEST(Codec, PosesComeBackToTheLastBit) {
  std::mt19937_64 rng(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  MapUpdate update;
  update.submap = SubmapId(0);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Quaterniond q(uniform(rng), uniform(rng), uniform(rng), uniform(rng));
    update.keyframes.push_back({KeyframeId(i), Rigid3(q, {uniform(rng), uniform(rng), uniform(rng)})});
  }
  Record record = MakeSyntheticStream(SmallFlight()).back();
  record.body = std::move(update);
  const EncodedRecord sent = EncodeRecord(record);
  const DecodedRecord read = DecodeRecord(sent.channel, sent.data.data(), static_cast<int>(sent.data.size()));
  ASSERT_TRUE(read.record) << read.error;
  EXPECT_EQ(EncodeRecord(*read.record).data, sent.data);
}

TEST(Codec, KeyframeKeepsItsValues) {
  const Record record = MakeSyntheticStream(SmallFlight())[3];
  const EncodedRecord encoded = EncodeRecord(record);
  const DecodedRecord decoded =
      DecodeRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()));
  const auto& a = std::get<KeyframeRecord>(record.body);
  const auto& b = std::get<KeyframeRecord>(decoded.record->body);
  EXPECT_EQ(encoded.channel, channels::kKeyframe);
  EXPECT_EQ(a.features.descriptors, b.features.descriptors);
  EXPECT_EQ(a.features.colors, b.features.colors);
  EXPECT_EQ(a.map_points, b.map_points);
  EXPECT_EQ(a.words, b.words);
  EXPECT_EQ(a.bow.words, b.bow.words);
  EXPECT_EQ(a.bow.weights, b.bow.weights);
  EXPECT_EQ(a.features.keypoints[7].pixel, b.features.keypoints[7].pixel);
  EXPECT_LT((a.cam_from_submap.translation - b.cam_from_submap.translation).norm(), 1e-15);
  EXPECT_LT(a.cam_from_submap.rotation.angularDistance(b.cam_from_submap.rotation), 1e-12);
}

TEST(Codec, RefusesWhatNoFrontendSends) {
  EXPECT_EQ(ErrorOfChangedKeyframe([](keyframe_t*) {}), "");
  EXPECT_NE(ErrorOfChangedKeyframe([](keyframe_t* m) { m->cam_from_submap[0] = std::nan(""); }).find("not finite"),
            std::string::npos);
  EXPECT_NE(ErrorOfChangedKeyframe([](keyframe_t* m) { m->cam_from_submap[6] = 2; }).find("quaternion"),
            std::string::npos);
  EXPECT_NE(ErrorOfChangedKeyframe([](keyframe_t* m) { m->octave[2] = -1; }).find("octave"), std::string::npos);
  EXPECT_NE(ErrorOfChangedKeyframe([](keyframe_t* m) { m->map_point[2] = -2; }).find("map_point"), std::string::npos);
  EXPECT_NE(
      ErrorOfChangedKeyframe([](keyframe_t* m) { m->keyframe = std::numeric_limits<int32_t>::max(); }).find("range"),
      std::string::npos);
  EXPECT_NE(
      ErrorOfChangedKeyframe([](keyframe_t* m) { m->y[0] = std::numeric_limits<float>::infinity(); }).find("finite"),
      std::string::npos);
  EXPECT_NE(ErrorOfChangedKeyframe([](keyframe_t* m) { std::swap(m->bow_word[0], m->bow_word[1]); }).find("ascend"),
            std::string::npos);
  EXPECT_NE(ErrorOfChangedKeyframe([](keyframe_t* m) { m->bow_word.back() = InvertedIndex::kMaxWords; }).find("range"),
            std::string::npos);
  EXPECT_NE(ErrorOfChangedKeyframe([](keyframe_t* m) { m->frame = std::numeric_limits<int32_t>::max(); }).find("range"),
            std::string::npos);
  EXPECT_NE(ErrorOfChangedKeyframe([](keyframe_t* m) { m->header.seq = -5; }).find("seq"), std::string::npos);
  EXPECT_NE(ErrorOfChangedKeyframe([](keyframe_t* m) { m->header.session = "../etc"; }).find("session"),
            std::string::npos);
  EXPECT_NE(ErrorOfChangedKeyframe([](keyframe_t* m) {
              m->descriptors.pop_back();
              --m->num_descriptor_bytes;
            }).find("num_descriptor_bytes"),
            std::string::npos);
}

Record WideRecord() {
  std::mt19937 rng(4);
  WideFeaturesRecord body;
  body.submap = SubmapId(2);
  body.keyframe = KeyframeId(17);
  body.frame = 93;
  for (int i = 0; i < 40; ++i) {
    const auto coordinate = [&] { return static_cast<float>(rng() % 10000) * 0.0625F - 20; };
    body.features.keypoints.push_back(
        {{coordinate(), coordinate()}, static_cast<uint8_t>(rng() % 256), static_cast<uint8_t>(rng() % 256)});
    for (uint8_t& v : body.features.descriptors.emplace_back()) v = static_cast<uint8_t>(rng() % 128);
  }
  return {{"flight", 5, 123456}, std::move(body)};
}

TEST(Codec, WideFeaturesComeBackAsTheyWere) {
  const Record record = WideRecord();
  const EncodedRecord encoded = EncodeRecord(record);
  EXPECT_EQ(encoded.channel, channels::kWideFeatures);
  EXPECT_TRUE(IsRecordChannel(encoded.channel));
  EXPECT_LT(encoded.data.size(), 40 * 140 + 100u) << "packed";
  const DecodedRecord decoded =
      DecodeRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()));
  ASSERT_TRUE(decoded.record) << decoded.error;
  const auto &a = std::get<WideFeaturesRecord>(record.body), &b = std::get<WideFeaturesRecord>(decoded.record->body);
  EXPECT_EQ(b.submap, a.submap);
  EXPECT_EQ(b.keyframe, a.keyframe);
  EXPECT_EQ(b.frame, a.frame);
  EXPECT_EQ(b.features.descriptors, a.features.descriptors);
  ASSERT_EQ(b.features.Size(), a.features.Size());
  for (int i = 0; i < a.features.Size(); ++i) {
    EXPECT_EQ(b.features.keypoints[i].pixel, a.features.keypoints[i].pixel);
    EXPECT_EQ(b.features.keypoints[i].size, a.features.keypoints[i].size);
    EXPECT_EQ(b.features.keypoints[i].angle, a.features.keypoints[i].angle);
  }
  EXPECT_EQ(EncodeRecord(*decoded.record).data, encoded.data);
}

TEST(Codec, PositionsComeBackAsTheyWere) {
  PositionsRecord body;
  PositionFix told;
  told.utime = 1525003606000000;
  told.latitude_deg = 28.0412532222222;
  told.longitude_deg = -82.6984742222222;
  told.altitude_m = -5.677;
  told.sigma_horizontal_m = 1.5;
  told.yaw_deg = 92.5;
  PositionFix bare;
  bare.latitude_deg = 1;
  body.fixes = {told, bare};
  const auto encode = [&] {
    Record record;  // step by step, because GCC 12 takes braces here for uninitialised
    record.header = {"flight", 5, 123456};
    record.body = body;
    return EncodeRecord(record);
  };
  const EncodedRecord encoded = encode();
  EXPECT_EQ(encoded.channel, channels::kPositions);
  EXPECT_TRUE(IsRecordChannel(encoded.channel));
  const DecodedRecord decoded = DecodeRecord(encoded);
  ASSERT_TRUE(decoded.record) << decoded.error;
  const auto& fixes = std::get<PositionsRecord>(decoded.record->body).fixes;
  ASSERT_EQ(fixes.size(), 2u);
  EXPECT_EQ(fixes[0].utime, told.utime);
  EXPECT_EQ(fixes[0].latitude_deg, told.latitude_deg);
  EXPECT_EQ(fixes[0].altitude_m, told.altitude_m);
  EXPECT_EQ(fixes[0].sigma_horizontal_m, 1.5);
  EXPECT_FALSE(fixes[0].HasAngles());
  EXPECT_FALSE(fixes[1].HasAltitude());
  EXPECT_EQ(EncodeRecord(*decoded.record).data, encoded.data);
  // What cannot be a position is refused.
  for (const double latitude : {95.0, std::numeric_limits<double>::quiet_NaN()}) {
    body.fixes[1].latitude_deg = latitude;
    EXPECT_FALSE(DecodeRecord(encode()).record);
  }
}

TEST(Codec, RefusesWideFeaturesThatNoFrontendSends) {
  const EncodedRecord sound = EncodeRecord(WideRecord());
  const auto error = [&](const std::function<void(wide_features_t*)>& change) {
    wide_features_t message{};
    EXPECT_TRUE(DecodeMessage(sound.data.data(), static_cast<int>(sound.data.size()), &message));
    change(&message);
    EncodedRecord encoded = sound;
    encoded.data = EncodeMessage(message);
    return DecodeError(encoded);
  };
  EXPECT_EQ(error([](wide_features_t*) {}), "");
  EXPECT_NE(error([](wide_features_t* m) { m->x[3] = std::numeric_limits<float>::quiet_NaN(); }).find("finite"),
            std::string::npos);
  EXPECT_NE(error([](wide_features_t* m) { m->descriptors[9] = 128; }).find("descriptor"), std::string::npos);
  EXPECT_NE(error([](wide_features_t* m) { m->keyframe = -2; }).find("range"), std::string::npos);
  EXPECT_NE(error([](wide_features_t* m) {
              m->descriptors.pop_back();
              --m->num_descriptor_bytes;
            }).find("num_descriptor_bytes"),
            std::string::npos);
}

TEST(Codec, RefusesARecordOnAnotherChannel) {
  EncodedRecord encoded = EncodeRecord(MakeSyntheticStream(SmallFlight())[3]);
  encoded.channel = channels::kMapUpdate;
  EXPECT_NE(DecodeError(encoded).find("map_update_t"), std::string::npos);
  encoded.channel = channels::kHealth;
  EXPECT_NE(DecodeError(encoded), "");
}

TEST(Codec, EncodingAKeyframeWhoseCountsDisagreeThrows) {
  Record record = MakeSyntheticStream(SmallFlight())[3];
  std::get<KeyframeRecord>(record.body).words.pop_back();
  EXPECT_THROW(EncodeRecord(record), std::invalid_argument);
}

TEST(Codec, PeekHeaderReadsOnlyTheHeader) {
  const EncodedRecord encoded = EncodeRecord(MakeSyntheticStream(SmallFlight())[3]);
  const auto header = PeekHeader(encoded.data.data(), 100);
  ASSERT_TRUE(header);
  EXPECT_EQ(header->seq, 3);
  EXPECT_EQ(header->session, SmallFlight().session);
  EXPECT_FALSE(PeekHeader(encoded.data.data(), 20));
  EXPECT_FALSE(PeekHeader(encoded.data.data(), 0));
}

}  // namespace codec_test
}  // namespace mapmend
