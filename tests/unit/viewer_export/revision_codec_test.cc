#include "procs/viewer_export/revision_codec.h"

#include <gtest/gtest.h>

#include <limits>
#include <mapmend/revision_part_t.hpp>
#include <mapmend/revision_t.hpp>

namespace mapmend {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

revision_t MakeRevision() {
  revision_t message{};
  message.transforms.revision = 7;
  message.transforms.refined = 1;
  message.transforms.is_final = 1;
  cursor_t cursor{};
  cursor.session = "s";
  cursor.seq = 41;
  message.transforms.cursors.push_back(cursor);
  for (int i = 0; i < 2; ++i) {
    merged_submap_t submap{};
    submap.session = "s";
    submap.submap = i;
    submap.root_from_submap[6] = 1;
    submap.root_from_submap[7] = 1 + i;
    submap.is_root = i == 0;
    message.transforms.submaps.push_back(submap);
  }
  message.transforms.num_edges = 1;
  message.transforms.edge_a = {0};
  message.transforms.edge_b = {1};
  connection_t connection{};
  connection.session_a = connection.session_b = "s";
  connection.submap_b = 1;
  connection.verdict = connection_t::ACCEPTED;
  connection.num_connected_frames = 5;
  connection.b_from_a[6] = 1;
  connection.b_from_a[7] = 0.5;
  connection.in_tree = 1;
  message.connections.push_back(connection);
  return message;
}

revision_part_t MakePart() {
  revision_part_t part{};
  part.revision = 7;
  part.session = "s";
  part.submap = 1;
  part.num_keyframes = 1;
  part.keyframe = {3};
  part.cam_from_root = {1, 2, 3, 0, 0, 0, 1};
  part.scale = {2};
  part.num_points = 1;
  part.point = {9};
  part.position = {4, 5, 6};
  part.num_fused = 1;
  part.fused_point = {10};
  part.into_session = {"s"};
  part.into_point = {1};
  return part;
}

TEST(RevisionCodecTest, ReadsEveryField) {
  const MapRevision map = DecodeRevision(MakeRevision(), {MakePart()});
  EXPECT_EQ(map.revision, 7);
  EXPECT_TRUE(map.refined);
  EXPECT_TRUE(map.final);
  EXPECT_EQ(map.cursors.at("s"), 41);
  ASSERT_EQ(map.submaps.size(), 2u);
  EXPECT_EQ(map.submaps[1].root_from_submap.scale, 2);
  EXPECT_TRUE(map.submaps[0].is_root);
  ASSERT_EQ(map.tree.size(), 1u);
  EXPECT_EQ(map.tree[0].second.submap.value, 1);
  ASSERT_EQ(map.connections.size(), 1u);
  EXPECT_EQ(map.connections[0].num_connected_frames, 5);
  EXPECT_EQ(map.connections[0].b_from_a.scale, 0.5);
  const RefinedSubmap& refined = map.refinement.at({"s", SubmapId(1)});
  EXPECT_EQ(refined.keyframes.at(KeyframeId(3)).cam_from_root.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(refined.keyframes.at(KeyframeId(3)).scale, 2);
  EXPECT_EQ(refined.points.at(MapPointId(9)), Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(refined.fused.at(MapPointId(10)).second, MapPointId(1));
}

TEST(RevisionCodecTest, RefusesWhatCannotBe) {
  const auto refused = [](auto change_revision, auto change_part) {
    revision_t revision = MakeRevision();
    revision_part_t part = MakePart();
    change_revision(&revision);
    change_part(&part);
    EXPECT_THROW(DecodeRevision(revision, {part}), std::runtime_error);
  };
  const auto nothing = [](auto*) {};
  refused([](revision_t* r) { r->transforms.submaps[0].root_from_submap[7] = 0; }, nothing);
  refused([](revision_t* r) { r->transforms.submaps[0].root_from_submap[0] = kNan; }, nothing);
  refused([](revision_t* r) { r->transforms.edge_b[0] = 2; }, nothing);
  refused([](revision_t* r) { r->transforms.edge_a[0] = -1; }, nothing);
  refused([](revision_t* r) { r->connections[0].verdict = 9; }, nothing);
  refused([](revision_t* r) { r->connections[0].strength = kNan; }, nothing);
  refused([](revision_t* r) { r->connections[0].b_from_a[6] = 0; }, nothing);
  refused(nothing, [](revision_part_t* p) { p->revision = 6; });
  refused(nothing, [](revision_part_t* p) { p->cam_from_root.pop_back(); });
  refused(nothing, [](revision_part_t* p) { p->cam_from_root[6] = 0; });
  refused(nothing, [](revision_part_t* p) { p->scale[0] = -1; });
  refused(nothing, [](revision_part_t* p) { p->position.push_back(1); });
}

TEST(RevisionCodecTest, ARejectedPairNeedsNoTransform) {
  connection_t connection{};
  connection.verdict = connection_t::REJECTED;
  connection.reason = "7 inliers";
  const EvaluatedConnection decoded = DecodeConnection(connection);
  EXPECT_EQ(decoded.verdict, EvaluatedConnection::Verdict::kRejected);
  EXPECT_EQ(decoded.reason, "7 inliers");
  EXPECT_EQ(decoded.b_from_a.scale, 1.0);
}

}  // namespace
}  // namespace mapmend
