#include "libs/connecting/motion_bridge.h"

#include <gtest/gtest.h>

#include "tests/merger_fixture.h"
#include "tests/synthetic_flight.h"

namespace mapmend {
namespace motion_bridge_test {

using testing::Frame;
using testing::Strip;
using testing::SyntheticFlight;
using testing::Terrain;

constexpr char kSession[] = "11111111-0000-0000-0000-000000000000";
constexpr int kBefore = 0, kPart = 1, kBehind = 2;

SubmapKey Key(int submap) { return {kSession, SubmapId(submap)}; }

// One strip, a keyframe a second and 6 m, that was lost for a moment twice. The camera behind the second gap has not
// seen what was seen before the first one.
SyntheticFlight Flight(const Eigen::Vector2d& end_of_part = {250, 200}, const Similarity3& last = Frame(0.05, 1.7)) {
  SyntheticFlight flight(kSession, 1000, Terrain(), {});
  flight.AddSubmap(Strip({40, 200}, {142, 200}, 80, 18, 90), Frame(0.02, 0.3));
  flight.AddSubmap(Strip({148, 200}, end_of_part, 80, 18, 90), Frame(0.3, -0.9));
  flight.AddSubmap(Strip({256, 200}, {358, 200}, 80, 18, 90), last);
  flight.End();
  return flight;
}

Similarity3 Truth(const SyntheticFlight& flight, int a, int b) {
  return flight.submap_from_world()[b] * flight.submap_from_world()[a].Inverse();
}

// A graph that knows how the first and the last submap lie.
ConnectionGraph JoinedAround(const SyntheticFlight& flight, const Sessions& sessions) {
  ConnectionGraph graph{ConnectionGraphOptions{}};
  ConnectedFrames frames;
  frames.success = frames.by_motion = true;  // stands for whatever has joined them
  frames.keyframe_a = sessions.at(kSession).submaps.at(SubmapId(kBefore)).keyframes.begin()->first;
  frames.keyframe_b = sessions.at(kSession).submaps.at(SubmapId(kBehind)).keyframes.begin()->first;
  frames.b_from_a = Truth(flight, kBefore, kBehind);
  frames.information = 1e8 * Matrix7d::Identity();
  graph.Add({Key(kBefore), Key(kBehind)}, frames);
  return graph;
}

// Where the found transform puts the part's cameras, metres of error at most.
double WorstCamera(const SyntheticFlight& flight, const Sessions& sessions, const Connection& c) {
  const Similarity3 truth = Truth(flight, static_cast<int>(c.a.submap.value), static_cast<int>(c.b.submap.value));
  double worst = 0;
  for (const auto& [id, keyframe] : ViewSubmap(sessions, c.a).submap->keyframes) {
    const Eigen::Vector3d center = keyframe.cam_from_submap.Center();
    const double in_b = (c.b_from_a * center - truth * center).norm();
    worst = std::max(worst, in_b / flight.submap_from_world()[static_cast<size_t>(c.b.submap.value)].scale);
  }
  return worst;
}

TEST(MotionBridge, APartBetweenJoinedStretchesIsPlacedByTheCamerasMotion) {
  const SyntheticFlight flight = Flight();
  const Sessions sessions{{kSession, flight.Model()}};
  ConnectionGraph graph = JoinedAround(flight, sessions);
  const SubmapPair first{Key(kBefore), Key(kPart)}, second{Key(kPart), Key(kBehind)};
  EXPECT_EQ(BridgeByMotion(sessions, {}, &graph), (std::set<SubmapPair>{first, second}));
  EXPECT_EQ(graph.forest().num_components, 1);
  for (const SubmapPair& pair : {first, second}) {
    const Connection& c = graph.connections().at(pair);
    ASSERT_EQ(c.verdict, Connection::Verdict::kAccepted) << c.reason;
    EXPECT_EQ(c.kind, ConnectionKind::kMotion);
    EXPECT_EQ(KindOf(c), ConnectionKind::kMotion) << c.reason;
    EXPECT_EQ(c.strength, 1) << "weaker than anything that was seen";
    const Similarity3 truth = Truth(flight, static_cast<int>(c.a.submap.value), static_cast<int>(c.b.submap.value));
    EXPECT_NEAR(c.b_from_a.scale / truth.scale, 1, 0.01);
    EXPECT_LT(RotationAngle(c.b_from_a.rotation * truth.rotation.conjugate()), 0.01);
    EXPECT_LT(WorstCamera(flight, sessions, c), 1.5) << "of 80 m of height";
  }
}

// Not even if both lie where they belong, as if by chance.
TEST(MotionBridge, BetweenStretchesThatNothingJoinsItStaysApart) {
  const SyntheticFlight flight = Flight({250, 200}, Frame(0.02, 0.3));
  const Sessions sessions{{kSession, flight.Model()}};
  ConnectionGraph graph{ConnectionGraphOptions{}};
  EXPECT_TRUE(BridgeByMotion(sessions, {}, &graph).empty());
  EXPECT_TRUE(graph.connections().empty());
}

TEST(MotionBridge, APartWhoseShapeDoesNotFitStaysApart) {
  const SyntheticFlight flight = Flight({235, 245});  // flown in another direction, and looking in the same one
  const Sessions sessions{{kSession, flight.Model()}};
  ConnectionGraph graph = JoinedAround(flight, sessions);
  EXPECT_TRUE(BridgeByMotion(sessions, {}, &graph).empty());
  EXPECT_EQ(graph.forest().num_components, 2);
}

TEST(MotionBridge, AcrossLongGapsNothingIsKnown) {
  const SyntheticFlight flight = Flight();
  const Sessions sessions{{kSession, flight.Model()}};
  ConnectionGraph graph = JoinedAround(flight, sessions);
  MotionBridgeOptions options;
  options.max_gap_s = 0.9;
  EXPECT_TRUE(BridgeByMotion(sessions, options, &graph).empty());
  options.max_gap_s = 1.1;
  EXPECT_FALSE(BridgeByMotion(sessions, options, &graph).empty());
}

TEST(MotionBridge, WhatStaysOpenIsBounded) {
  const SyntheticFlight flight = Flight();
  const Sessions sessions{{kSession, flight.Model()}};
  for (double RelationSigmas::*const bound :
       {&RelationSigmas::rotation, &RelationSigmas::translation, &RelationSigmas::scale}) {
    ConnectionGraph graph = JoinedAround(flight, sessions);
    MotionBridgeOptions options;
    options.max_open.*bound = 1e-6;
    EXPECT_TRUE(BridgeByMotion(sessions, options, &graph).empty());
  }
}

// However evenly the camera flew before and behind: 6 m of 80 were flown across each gap.
TEST(MotionBridge, AQuarterOfTheWayAcrossAGapStaysOpen) {
  const SyntheticFlight flight = Flight();
  const Sessions sessions{{kSession, flight.Model()}};
  ConnectionGraph graph = JoinedAround(flight, sessions);
  MotionBridgeOptions options;
  options.max_open.translation = 0.01;
  EXPECT_TRUE(BridgeByMotion(sessions, options, &graph).empty());
  options.max_open.translation = 0.025;
  EXPECT_FALSE(BridgeByMotion(sessions, options, &graph).empty());
}

TEST(MotionBridge, APersonsWordCounts) {
  const SyntheticFlight flight = Flight();
  const Sessions sessions{{kSession, flight.Model()}};
  ConnectionGraph graph = JoinedAround(flight, sessions);
  graph.SetDecisions({{Key(kBefore), Key(kPart), true}, {Key(kPart), Key(kBehind), true}});
  BridgeByMotion(sessions, {}, &graph);
  EXPECT_EQ(graph.forest().num_components, 2);
  const Connection& c = graph.connections().at({Key(kBefore), Key(kPart)});
  EXPECT_EQ(c.verdict, Connection::Verdict::kDeactivated);
  EXPECT_TRUE(c.reason.starts_with(ReasonPrefix(ConnectionKind::kMotion))) << c.reason;
}

}  // namespace motion_bridge_test
}  // namespace mapmend
