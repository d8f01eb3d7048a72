#include "libs/connecting/connection_graph.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/synthetic_flight.h"

namespace mapmend {
namespace connection_graph_test {

using testing::MakeTerrain;
using testing::Strip;
using testing::SyntheticFlight;
using testing::TerrainPoint;

const SubmapKey kFirst{"s", SubmapId(0)}, kSecond{"s", SubmapId(1)}, kThird{"s", SubmapId(2)};

Similarity3 Frame(double scale) {
  Similarity3 frame;
  frame.scale = scale;
  return frame;
}

// Three strips side by side, each of which overlaps with both others, and all connected frames between them.
class ConnectionGraphTest : public ::testing::Test {
 protected:
  ConnectionGraphTest() {
    std::mt19937_64 random(5);
    static const std::vector<TerrainPoint> terrain = MakeTerrain({});
    SyntheticFlight flight("s", 0, terrain, {});
    flight.AddSubmap(Strip({80, 100}, {240, 100}, 100, 6, 90, &random), Frame(0.02));
    flight.AddSubmap(Strip({80, 120}, {240, 120}, 100, 6, 90, &random), Frame(0.05));
    flight.AddSubmap(Strip({120, 140}, {240, 140}, 100, 5, 90, &random), Frame(0.03));
    flight.End();
    sessions_.emplace("s", flight.Model());
  }

  // All connected frames of a pair, in the order of their keyframes.
  const std::vector<ConnectedFrames>& Evidence(const SubmapPair& pair) const {
    static std::map<SubmapPair, std::vector<ConnectedFrames>> found;  // the same in all tests
    std::vector<ConnectedFrames>& evidence = found[pair];
    if (!evidence.empty()) return evidence;
    const SubmapView a = ViewSubmap(sessions_, pair.older), b = ViewSubmap(sessions_, pair.younger);
    for (const auto& [ka, keyframe_a] : a.submap->keyframes) {
      for (const auto& [kb, keyframe_b] : b.submap->keyframes) {
        ConnectedFrames frames = VerifyConnectedFrames(a, ka, b, kb, {});
        if (frames.success) evidence.push_back(std::move(frames));
      }
    }
    EXPECT_GE(evidence.size(), 2u);
    return evidence;
  }
  void AddAll(const SubmapPair& pair, ConnectionGraph* graph) const {
    for (const ConnectedFrames& frames : Evidence(pair)) graph->Add(pair, frames);
  }
  const Connection& At(const ConnectionGraph& graph, const SubmapPair& pair) const {
    return graph.connections().at(pair);
  }

  Sessions sessions_;
  const SubmapPair pair01_{kFirst, kSecond}, pair02_{kFirst, kThird}, pair12_{kSecond, kThird};
};

TEST_F(ConnectionGraphTest, APairHasTheOlderSubmapFirst) {
  EXPECT_EQ(MakePair(sessions_, kThird, kFirst), pair02_);
  EXPECT_EQ(MakePair(sessions_, kFirst, kThird), pair02_);
  Session later = sessions_.at("s");
  later.start_utime += 1000000;
  sessions_.emplace("a", later);  // its name would come first
  EXPECT_EQ(MakePair(sessions_, {"a", SubmapId(0)}, kThird), (SubmapPair{kThird, {"a", SubmapId(0)}}));
}

TEST_F(ConnectionGraphTest, TheForestIsTheStrongestAndLeavesTheWeakestEdgeOfACycleOut) {
  ConnectionGraph graph({});
  for (const SubmapPair& pair : {pair01_, pair12_, pair02_}) AddAll(pair, &graph);
  graph.Solve(sessions_, {}, false);
  ASSERT_EQ(graph.num_accepted(), 3);
  EXPECT_EQ(graph.forest().num_components, 1);
  ASSERT_EQ(graph.tree().size(), 2u);
  double weakest = 1e9;
  for (const auto& [pair, connection] : graph.connections()) weakest = std::min(weakest, connection.strength);
  for (const SubmapPair& pair : graph.TreePairs()) EXPECT_GT(At(graph, pair).strength, weakest);
}

TEST_F(ConnectionGraphTest, DoesNotDependOnTheOrderOfAdd) {
  ConnectionGraph forward({}), backward({});
  for (const SubmapPair& pair : {pair01_, pair12_, pair02_}) AddAll(pair, &forward);
  for (const SubmapPair& pair : {pair02_, pair12_, pair01_}) {
    std::vector<ConnectedFrames> evidence = Evidence(pair);
    std::reverse(evidence.begin(), evidence.end());
    for (ConnectedFrames& frames : evidence) backward.Add(pair, std::move(frames));
  }
  forward.Solve(sessions_, {}, false);
  backward.Solve(sessions_, {}, false);
  EXPECT_EQ(forward.TreePairs(), backward.TreePairs());
  for (const auto& [pair, connection] : forward.connections()) {
    EXPECT_EQ(connection.num_connected_frames, At(backward, pair).num_connected_frames);
    EXPECT_EQ(connection.num_common_points, At(backward, pair).num_common_points);
    EXPECT_DOUBLE_EQ(connection.strength, At(backward, pair).strength);
  }
}

TEST_F(ConnectionGraphTest, AnEdgeWeakerThanTheLeastStrengthIsRejected) {
  ConnectionGraph graph({});
  AddAll(pair01_, &graph);
  graph.Solve(sessions_, {}, false);
  const double strength = At(graph, pair01_).strength;
  for (const double share : {0.99, 1.01}) {
    ConnectionGraphOptions options;
    options.connection.min_strength = share * strength;
    ConnectionGraph bounded(options);
    AddAll(pair01_, &bounded);
    bounded.Solve(sessions_, {}, false);
    EXPECT_EQ(bounded.IsAccepted(pair01_), share < 1);
    EXPECT_EQ(bounded.TreePairs().size(), share < 1 ? 1u : 0u);
  }
}

TEST_F(ConnectionGraphTest, EvidenceThatContradictsTheMajorityIsSetAside) {
  ConnectionGraph graph({});
  std::vector<ConnectedFrames> evidence = Evidence(pair01_);
  ConnectedFrames contradiction = evidence.back();
  evidence.pop_back();
  contradiction.num_inliers = 1;
  for (auto* matches : {&contradiction.a_in_b, &contradiction.b_in_a}) {
    for (CrossMatch& match : *matches) match.pixel.x() += 150;
  }
  for (const ConnectedFrames& frames : evidence) graph.Add(pair01_, frames);
  graph.Add(pair01_, contradiction);
  graph.Solve(sessions_, {}, false);
  const Connection& connection = At(graph, pair01_);
  EXPECT_TRUE(graph.IsAccepted(pair01_));
  EXPECT_EQ(connection.num_connected_frames, static_cast<int>(evidence.size()));
  EXPECT_EQ(connection.agrees.back(), 0);
  EXPECT_NE(connection.reason.find("1 more contradict"), std::string::npos) << connection.reason;
}

TEST_F(ConnectionGraphTest, ARejectionNamesTheFailureThatCameNearest) {
  ConnectionGraph graph({});
  for (const auto& [inliers, reason] : {std::pair(3, "far"), std::pair(20, "near"), std::pair(7, "between")}) {
    ConnectedFrames failure;
    failure.num_inliers = inliers;
    failure.reason = reason;
    graph.Add(pair02_, failure);
  }
  graph.Solve(sessions_, {pair02_}, false);
  EXPECT_EQ(At(graph, pair02_).num_candidates, 3);
  EXPECT_NE(At(graph, pair02_).reason.find("near"), std::string::npos) << At(graph, pair02_).reason;
}

TEST_F(ConnectionGraphTest, WhatPeopleHaveSwitchedOffIsNotUsedUntilTheyThinkBetter) {
  ConnectionGraph graph({});
  AddAll(pair01_, &graph);
  graph.SetDecisions({{kSecond, kFirst, true}});
  graph.Solve(sessions_, {}, false);
  EXPECT_TRUE(graph.tree().empty());
  EXPECT_EQ(At(graph, pair01_).verdict, Connection::Verdict::kDeactivated);
  EXPECT_NE(At(graph, pair01_).reason.find("by hand"), std::string::npos);
  graph.SetDecisions({{kSecond, kFirst, true}, {kFirst, kSecond, false}});
  EXPECT_EQ(graph.Solve(sessions_, {}, false).size(), 1u);
  EXPECT_TRUE(graph.IsAccepted(pair01_));

  ConnectionGraph next = graph.WithoutConnections();
  EXPECT_TRUE(next.connections().empty());
  EXPECT_EQ(next.num_decisions(), 2);
}

TEST_F(ConnectionGraphTest, AChangedSubmapsConnectionsAreEstimatedAnew) {
  ConnectionGraph graph({});
  AddAll(pair01_, &graph);
  graph.Solve(sessions_, {}, false);
  const double scale = At(graph, pair01_).b_from_a.scale;
  Submap& second = sessions_.at("s").submaps.at(SubmapId(1));
  for (auto& [id, point] : second.points) point.position *= 2;
  for (auto& [id, keyframe] : second.keyframes) keyframe.cam_from_submap.translation *= 2;
  graph.Solve(sessions_, {}, false);
  EXPECT_DOUBLE_EQ(At(graph, pair01_).b_from_a.scale, scale);
  graph.Reestimate(kThird);
  graph.Solve(sessions_, {}, false);
  EXPECT_DOUBLE_EQ(At(graph, pair01_).b_from_a.scale, scale);
  graph.Reestimate(kSecond);
  graph.Solve(sessions_, {}, false);
  EXPECT_NEAR(At(graph, pair01_).b_from_a.scale / scale, 2, 0.01);
}

TEST_F(ConnectionGraphTest, TellsWhatWasLookedAtAndWhatHasChanged) {
  ConnectionGraph graph({});
  AddAll(pair01_, &graph);
  EXPECT_EQ(graph.Solve(sessions_, {}, false).size(), 1u);  // it is in the tree now
  EXPECT_TRUE(graph.Solve(sessions_, {}, false).empty());
  EXPECT_EQ(graph.Solve(sessions_, {pair01_}, false).size(), 1u);
  AddAll(pair12_, &graph);
  const std::vector<const Connection*> news = graph.Solve(sessions_, {}, false);
  ASSERT_EQ(news.size(), 1u);
  EXPECT_EQ(news[0]->a, kSecond);
  EXPECT_EQ(graph.Solve(sessions_, {}, true).size(), 2u);
}

TEST_F(ConnectionGraphTest, KnowsItsEvidenceAndWhenItIsEnough) {
  ConnectionGraphOptions options;
  options.max_evidence = 2;
  ConnectionGraph graph(options);
  const std::vector<ConnectedFrames>& evidence = Evidence(pair01_);
  EXPECT_FALSE(graph.IsFull(pair01_));
  graph.Add(pair01_, evidence[0]);
  EXPECT_TRUE(graph.Knows(pair01_, evidence[0].keyframe_a, evidence[0].keyframe_b));
  EXPECT_FALSE(graph.Knows(pair01_, evidence[1].keyframe_a, evidence[1].keyframe_b));
  EXPECT_FALSE(graph.IsFull(pair01_));
  graph.Add(pair01_, evidence[1]);
  EXPECT_TRUE(graph.IsFull(pair01_));
}

}  // namespace connection_graph_test
}  // namespace mapmend
