#include "procs/viewer_export/placed_map_export.h"

#include <gtest/gtest.h>

#include "tests/test_flight.h"

namespace mapmend {
namespace placed_map_export_test {

using Kind = PlacedRelation::Kind;

KeyframeId FirstKeyframe(const MapModel& model, const SubmapKey& key) {
  return model.GetSession(key.session).submaps.at(key.submap).keyframes.begin()->first;
}

// Both submaps joined by one pair of keyframes, and a loop in the second; the submaps' units differ by a factor of two.
MapModel JoinedModel(const TestFlight& flight, bool refined) {
  MapModel model = MakeModel(flight);
  MapRevision map = flight.Revision();
  map.connections[0].pairs = {{FirstKeyframe(model, flight.Key(0)), FirstKeyframe(model, flight.Key(1)), 150}};
  EvaluatedConnection loop = map.connections[0];
  loop.a = loop.b = flight.Key(1);
  loop.b_from_a = Similarity3();
  loop.in_tree = false;
  const KeyframeId first = FirstKeyframe(model, flight.Key(1));
  loop.pairs = {{first, KeyframeId(first.value + 1), 20}, {first, KeyframeId(first.value + 4), 90}};
  map.connections.push_back(loop);
  if (refined) map.refined = {flight.Refinement(0), flight.Refinement(1)};
  model.SetRevision(map);
  return model;
}

int Count(const PlacedMap& map, Kind kind) {
  return static_cast<int>(std::count_if(map.relations.begin(), map.relations.end(),
                                        [&](const PlacedRelation& relation) { return relation.kind == kind; }));
}

TEST(PlacedMapExport, RelationsAgreeWithPosesWhateverTheUnitsOfTheSubmaps) {
  for (const bool refined : {false, true}) {
    for (const bool moved : {false, true}) {
      const TestFlight flight;
      const MapModel model = JoinedModel(flight, refined);
      Snapshot snapshot = MakeSnapshot(model);
      FrameOfReference frame;
      frame.name = "enu";
      frame.unit = "m";
      if (moved) PlaceInFrame(frame, flight.WorldFromSubmap(0), 0, &snapshot);
      const PlacedMap map = MakePlacedMap(snapshot, 0);
      ASSERT_EQ(map.keyframes.size(), 10u);
      EXPECT_GT(Count(map, Kind::kTracked), 10);
      EXPECT_EQ(Count(map, Kind::kTree), 1);
      ASSERT_EQ(Count(map, Kind::kLoop), 1) << "the strongest pair only";
      EXPECT_EQ(map.relations.back().b - map.relations.back().a, 4);
      for (const PlacedRelation& relation : map.relations) {
        const Rigid3 expected =
            map.keyframes[relation.a].world_from_camera.Inverse() * map.keyframes[relation.b].world_from_camera;
        EXPECT_LT((relation.a_from_b.translation - expected.translation).norm(), 1e-4)
            << relation.a << " " << relation.b << " refined " << refined << " moved " << moved;
        EXPECT_LT(RotationAngle(relation.a_from_b.rotation.conjugate() * expected.rotation), 1e-6);
        // Depths are some 50 m.
        const double unit = moved ? 1 : 10, share = relation.kind == Kind::kTracked ? 0.005 : 0.01;
        EXPECT_NEAR(relation.sigma_translation * unit, share * 50, share * 5);
      }
    }
  }
}

TEST(PlacedMapExport, WhatOnlyMotionJoinsIsSaidToBeLoose) {
  const TestFlight flight;
  MapModel model = JoinedModel(flight, false);
  MapRevision map = model.Revision();
  map.connections[0].reason = ReasonPrefix(ConnectionKind::kMotion) + map.connections[0].reason;
  model.SetRevision(map);
  const PlacedMap placed = MakePlacedMap(MakeSnapshot(model), 0);
  const auto tree = std::find_if(placed.relations.begin(), placed.relations.end(),
                                 [](const PlacedRelation& relation) { return relation.kind == Kind::kTree; });
  ASSERT_NE(tree, placed.relations.end());
  EXPECT_DOUBLE_EQ(tree->sigma_rotation, 0.05);
  EXPECT_NEAR(tree->sigma_translation * 10, 0.05 * 50, 0.5);
}

TEST(PlacedMapExport, AMovedMapHasFramesPointsAndLossesInItsFrame) {
  const TestFlight flight;
  const MapModel model = JoinedModel(flight, true);
  Snapshot snapshot = MakeSnapshot(model);
  FrameOfReference frame;
  frame.name = "enu";
  PlaceInFrame(frame, flight.WorldFromSubmap(0), 0, &snapshot);
  const PlacedMap map = MakePlacedMap(snapshot, 0);
  ASSERT_EQ(map.frames.size(), 40u);
  for (const PlacedPose& pose : map.frames) {
    const Rigid3 truth = flight.WorldFromCamera(pose.frame);
    EXPECT_LT((pose.world_from_camera.translation - truth.translation).norm(), 1e-3);
    EXPECT_LT(RotationAngle(pose.world_from_camera.rotation.conjugate() * truth.rotation), 1e-6);
    EXPECT_EQ(pose.submap, pose.frame < 20 ? 0 : 1);
    EXPECT_EQ(pose.utime, TestFlight::Utime(pose.frame));
  }
  ASSERT_EQ(map.points.size(), 24u);
  for (const PlacedPoint& point : map.points) {
    EXPECT_NEAR(point.position.z(), 0, 1e-3) << "on the ground";
    EXPECT_EQ(point.num_images, 5);
  }
  ASSERT_EQ(map.losses.size(), 1u);
  EXPECT_EQ(map.losses[0].text, "Submap 0: tracking lost after frame 19, too few matches");
  EXPECT_EQ(map.losses[0].utime, TestFlight::Utime(19));
}

}  // namespace placed_map_export_test
}  // namespace mapmend
