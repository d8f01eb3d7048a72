#include "libs/wire/revision_codec.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <mapmend/connection_t.hpp>
#include <mapmend/revision_part_t.hpp>
#include <mapmend/revision_t.hpp>

#include "tests/unit/wire/random_values.h"

namespace mapmend {
namespace revision_codec_test {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

EvaluatedConnection RandomConnection(RandomValues* random) {
  EvaluatedConnection c;
  c.a = random->Key();
  c.b = random->Key();
  c.verdict = static_cast<EvaluatedConnection::Verdict>(random->Int(0, 2));
  c.reason = random->Text();
  c.num_connected_frames = random->Int(0, 100);
  c.num_common_points = random->Int(0, 10000);
  c.median_angle_deg = random->Real();
  c.strength = random->Real();
  c.num_candidates = random->Int(0, 100);
  c.num_inliers = random->Int(0, 1000);
  c.median_error_px = random->Positive();
  c.b_from_a = random->Similarity();
  c.in_tree = random->Bool();
  c.pairs = random->List<EvaluatedConnection::FramePair>(9, [&] {
    return EvaluatedConnection::FramePair{KeyframeId(random->Int(0, 99)), KeyframeId(random->Int(0, 99)),
                                          random->Int(0, 500)};
  });
  return c;
}

std::vector<EvaluatedConnection> RandomConnections(RandomValues* random) {
  return random->List<EvaluatedConnection>(6, [&] { return RandomConnection(random); });
}

MergedTransforms RandomTransforms(RandomValues* random) {
  MergedTransforms t;
  t.revision = random->Int(0, 1 << 30);
  t.cursors = random->List<StreamCursor>(4, [&] { return random->Cursor(); });
  t.refined = random->Bool();
  t.is_final = random->Bool();
  t.submaps = random->List<MergedTransforms::Place>(8, [&] {
    return MergedTransforms::Place{random->Key(), random->Int(0, 5), random->Similarity(), random->Bool()};
  });
  const int last = static_cast<int>(t.submaps.size()) - 1;
  if (last >= 0) {
    t.edges =
        random->List<std::pair<int, int>>(8, [&] { return std::pair(random->Int(0, last), random->Int(0, last)); });
  }
  return t;
}

RevisionHead RandomHead(RandomValues* random) {
  return {RandomTransforms(random), RandomConnections(random), random->Int(0, 1000)};
}

RevisionPart RandomPart(RandomValues* random) {
  RevisionPart part{random->Int(0, 1 << 30), random->Int(0, 1000), {random->Key(), {}, {}, {}}};
  part.submap.keyframes = random->List<RefinedSubmap::Keyframe>(20, [&] {
    return RefinedSubmap::Keyframe{KeyframeId(random->Int(0, 1 << 30)), random->Pose(), random->Positive()};
  });
  part.submap.points = random->List<RefinedSubmap::Point>(50, [&] {
    return RefinedSubmap::Point{MapPointId(random->Int(0, 1 << 30)),
                                {random->Float(), random->Float(), random->Float()}};
  });
  part.submap.fused = random->List<RefinedSubmap::Fused>(20, [&] {
    return RefinedSubmap::Fused{MapPointId(random->Int(0, 1 << 30)), random->Session(),
                                MapPointId(random->Int(0, 1 << 30))};
  });
  return part;
}

TEST(RevisionCodec, WhatIsEncodedComesBackToTheLastBit) {
  RandomValues random(1);
  for (int i = 0; i < 300; ++i) {
    ExpectBack(RandomConnection(&random));
    ExpectBack(RandomTransforms(&random));
    ExpectBack(RandomHead(&random));
    ExpectBack(RandomPart(&random));
    ExpectBack(GraphRequest{{random.Seq(), random.Text()}});
    ExpectBack(GraphReply{
        {random.Seq(), random.Text()}, RandomTransforms(&random), random.Int(0, 9), RandomConnections(&random)});
  }
}

// The layout of lcmtypes/revision_part_t.lcm and connection_t.lcm, which other programs read.
TEST(RevisionCodec, EveryFieldIsWhereItsMessageHasIt) {
  RandomValues random(2);
  EvaluatedConnection connection = RandomConnection(&random);
  connection.verdict = EvaluatedConnection::Verdict::kDeactivated;
  connection.pairs = {{KeyframeId(3), KeyframeId(8), 41}};
  connection_t message{};
  const auto data = Encode(connection);
  ASSERT_TRUE(DecodeMessage(data.data(), static_cast<int>(data.size()), &message));
  EXPECT_EQ(message.session_b, connection.b.session);
  EXPECT_EQ(message.submap_a, connection.a.submap.value);
  EXPECT_EQ(message.verdict, connection_t::DEACTIVATED);
  EXPECT_EQ(message.reprojection_error, connection.median_error_px);
  EXPECT_EQ(message.b_from_a[7], connection.b_from_a.scale);
  EXPECT_EQ(message.b_from_a[6], connection.b_from_a.rotation.w());
  EXPECT_EQ(message.keyframe_b, (std::vector<int32_t>{8}));
  EXPECT_EQ(message.pair_inliers, (std::vector<int32_t>{41}));

  RevisionPart part = RandomPart(&random);
  part.submap.fused = {{MapPointId(4), "older", MapPointId(2)}};
  part.submap.points = {{MapPointId(9), {4, 5, 6}}};
  revision_part_t part_message{};
  const auto bytes = Encode(part);
  ASSERT_TRUE(DecodeMessage(bytes.data(), static_cast<int>(bytes.size()), &part_message));
  EXPECT_EQ(part_message.part, part.part);
  EXPECT_EQ(part_message.submap, part.submap.key.submap.value);
  EXPECT_EQ(part_message.position, (std::vector<float>{4, 5, 6}));
  EXPECT_EQ(part_message.into_session, (std::vector<std::string>{"older"}));
  EXPECT_EQ(part_message.into_point, (std::vector<int32_t>{2}));
  EXPECT_EQ(part_message.num_pose_values, 7 * static_cast<int>(part.submap.keyframes.size()));
}

// The error of a sound message after change was made to it.
template <typename Message, typename Value>
std::string ErrorOfChanged(const Value& sound, const std::function<void(Message*)>& change) {
  Message message{};
  std::vector<uint8_t> data = Encode(sound);
  EXPECT_TRUE(Decode<Value>(data).value);
  EXPECT_TRUE(DecodeMessage(data.data(), static_cast<int>(data.size()), &message));
  change(&message);
  return Decode<Value>(EncodeMessage(message)).error;
}

RevisionHead SoundHead() {
  RevisionHead head;
  head.transforms.submaps = {{{"s", SubmapId(0)}, 0, {}, true}, {{"s", SubmapId(1)}, 0, {}, false}};
  head.transforms.edges = {{0, 1}};
  head.connections.resize(1);
  head.connections[0].a = {"s", SubmapId(0)};
  head.connections[0].b = {"s", SubmapId(1)};
  head.connections[0].verdict = EvaluatedConnection::Verdict::kAccepted;
  return head;
}

TEST(RevisionCodec, RefusesAHeadThatCannotBe) {
  const std::function<void(revision_t*)> changes[] = {
      [](revision_t* r) { r->transforms.revision = -1; },
      [](revision_t* r) { r->num_parts = -1; },
      [](revision_t* r) { r->num_parts = 1 << 30; },
      [](revision_t* r) { r->transforms.submaps[0].session = "../s"; },
      [](revision_t* r) { r->transforms.submaps[0].submap = -1; },
      [](revision_t* r) { r->transforms.submaps[0].root_from_submap[7] = 0; },
      [](revision_t* r) { r->transforms.submaps[0].root_from_submap[0] = kNan; },
      [](revision_t* r) { r->transforms.submaps[0].root_from_submap[4] = 0.3; },
      [](revision_t* r) { r->transforms.edge_b[0] = 2; },
      [](revision_t* r) { r->transforms.edge_a[0] = -1; },
      [](revision_t* r) { r->connections[0].session_a = ""; },
      [](revision_t* r) { r->connections[0].submap_b = -2; },
      [](revision_t* r) { r->connections[0].verdict = 9; },
      [](revision_t* r) { r->connections[0].verdict = -1; },
      [](revision_t* r) { r->connections[0].strength = kNan; },
      [](revision_t* r) { r->connections[0].median_angle_deg = kNan; },
      [](revision_t* r) { r->connections[0].b_from_a[2] = kNan; },
      [](revision_t* r) { r->connections[0].b_from_a[6] = 0; }};
  for (size_t i = 0; i < std::size(changes); ++i)
    EXPECT_NE(ErrorOfChanged<revision_t>(SoundHead(), changes[i]), "") << "change " << i;
}

TEST(RevisionCodec, RefusesAPartThatCannotBe) {
  RevisionPart sound;
  sound.revision = 7;
  sound.part = 0;
  sound.submap.key = {"s", SubmapId(1)};
  sound.submap.keyframes.push_back({KeyframeId(3), Rigid3(), 2});
  sound.submap.points.push_back({MapPointId(9), Eigen::Vector3f(4, 5, 6)});
  const std::function<void(revision_part_t*)> changes[] = {
      [](revision_part_t* p) { p->revision = -1; },
      [](revision_part_t* p) { p->part = -1; },
      [](revision_part_t* p) { p->session = "a b"; },
      [](revision_part_t* p) { p->submap = -1; },
      [](revision_part_t* p) { p->cam_from_root.pop_back(), --p->num_pose_values; },
      [](revision_part_t* p) { p->cam_from_root[6] = 0; },
      [](revision_part_t* p) { p->cam_from_root[1] = kNan; },
      [](revision_part_t* p) { p->scale[0] = -1; },
      [](revision_part_t* p) { p->scale[0] = kNan; },
      [](revision_part_t* p) { p->position[1] = std::numeric_limits<float>::infinity(); },
      [](revision_part_t* p) { p->position.push_back(1), ++p->num_position_values; }};
  for (size_t i = 0; i < std::size(changes); ++i)
    EXPECT_NE(ErrorOfChanged<revision_part_t>(sound, changes[i]), "") << "change " << i;
}

TEST(RevisionCodec, TheErrorNamesTheMessageAndTheField) {
  EXPECT_EQ(ErrorOfChanged<revision_t>(SoundHead(), [](revision_t* r) { r->connections[0].verdict = 9; }),
            "revision_t: verdict of a connection is unknown");
  EXPECT_EQ(Decode<RevisionHead>(std::vector<uint8_t>{1, 2, 3}).error, "not a revision_t");
}

TEST(RevisionCodec, ARejectedPairNeedsNoTransform) {
  connection_t message{};
  message.session_a = message.session_b = "s";
  message.verdict = connection_t::REJECTED;
  message.reason = "7 inliers";
  const Decoded<EvaluatedConnection> decoded = Decode<EvaluatedConnection>(EncodeMessage(message));
  ASSERT_TRUE(decoded.value) << decoded.error;
  EXPECT_EQ(decoded.value->verdict, EvaluatedConnection::Verdict::kRejected);
  EXPECT_EQ(decoded.value->reason, "7 inliers");
  EXPECT_EQ(decoded.value->b_from_a, Similarity3());
}

}  // namespace revision_codec_test
}  // namespace mapmend
