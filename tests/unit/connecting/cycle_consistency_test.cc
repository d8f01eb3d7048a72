#include "libs/connecting/cycle_consistency.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace cycle_consistency_test {

// Submaps at known places of one world, seen from 100 units; edges with the true transforms, or off by a shift of b.
struct World {
  std::vector<Similarity3> world_from;

  explicit World(int n) {
    for (int i = 0; i < n; ++i) {
      world_from.push_back({1 + 0.3 * i,
                            Eigen::Quaterniond(Eigen::AngleAxisd(0.7 * i, Eigen::Vector3d(1, i, 2).normalized())),
                            Eigen::Vector3d(40.0 * i, -25.0 * i, 3.0 * i)});
    }
  }
  CycleEdge Edge(int a, int b, double strength, const Eigen::Vector3d& shift = Eigen::Vector3d::Zero()) const {
    CycleEdge e;
    e.a = a;
    e.b = b;
    e.strength = strength;
    e.b_from_a = world_from[b].Inverse() * Similarity3(1, Eigen::Quaterniond::Identity(), shift) * world_from[a];
    e.information = 1e8 * Matrix7d::Identity();
    const Similarity3 a_from_world = world_from[a].Inverse();
    for (const auto& x : {Eigen::Vector3d(10, 0, 0), Eigen::Vector3d(0, 15, 0), Eigen::Vector3d(20, 10, 2)}) {
      e.probes_a.push_back(a_from_world * (x + 0.5 * (world_from[a].translation + world_from[b].translation)));
    }
    e.viewing_distance_a = 100 * a_from_world.scale;
    return e;
  }
};

TEST(CycleConsistency, TrueEdgesAllStay) {
  const World w(4);
  const auto result = FindConsistentForest(
      4, {w.Edge(0, 1, 9), w.Edge(1, 2, 8), w.Edge(2, 3, 7), w.Edge(0, 3, 6), w.Edge(0, 2, 5)}, {});
  EXPECT_EQ(result.active, (std::vector<char>{1, 1, 1, 1, 1}));
  ASSERT_EQ(result.cycles.size(), 2u);
  for (const Cycle& c : result.cycles) EXPECT_LT(c.displacement, 1e-9);
}

TEST(CycleConsistency, AWrongEdgeIsCaughtWhenItClosesACycle) {
  const World w(3);
  const auto result = FindConsistentForest(3, {w.Edge(0, 1, 9), w.Edge(1, 2, 8), w.Edge(0, 2, 3, {60, 0, 0})}, {});
  EXPECT_EQ(result.active, (std::vector<char>{1, 1, 0}));
  EXPECT_NE(result.reason[2].find("60 % of the viewing distance"), std::string::npos) << result.reason[2];
  EXPECT_TRUE(result.reason[0].empty());
}

TEST(CycleConsistency, AWrongEdgeInTheTreeIsReplacedByTheTrueOne) {
  // The wrong edge is not the weakest of all, but each cycle through it fails while the others confirm the rest.
  const World w(4);
  const auto result = FindConsistentForest(
      4, {w.Edge(0, 1, 9), w.Edge(1, 2, 4), w.Edge(0, 2, 3), w.Edge(2, 3, 8), w.Edge(1, 3, 5, {-80, 0, 0})}, {});
  EXPECT_EQ(result.active[4], 0) << result.reason[4];
  EXPECT_EQ(result.active, (std::vector<char>{1, 1, 1, 1, 0}));
  EXPECT_EQ(result.forest.edges, (std::vector<int>{0, 3, 1}));
}

TEST(CycleConsistency, TwoWeakWrongEdgesDoNotOutvoteTheStrongTruth) {
  const World w(4);
  const auto result = FindConsistentForest(
      4, {w.Edge(0, 1, 9), w.Edge(1, 2, 8), w.Edge(2, 3, 7), w.Edge(0, 2, 2, {70, 0, 0}), w.Edge(0, 3, 3, {0, 90, 0})},
      {});
  EXPECT_EQ(result.active, (std::vector<char>{1, 1, 1, 0, 0}));
}

TEST(CycleConsistency, AStrongEdgeThatIsSeldomRecognizedGoesBeforeAWeakerOneThatAlwaysIs) {
  const World w(3);
  const std::vector<CycleEdge> edges = {w.Edge(0, 1, 9), w.Edge(1, 2, 4), w.Edge(0, 2, 6, {60, 0, 0})};
  EXPECT_EQ(FindConsistentForest(3, edges, {}).active, (std::vector<char>{1, 0, 1}));  // nothing but strength to go by
  const auto credit = [](int e) { return e == 2 ? 0.4 : 0.9; };
  const auto result = FindConsistentForest(3, edges, {}, credit);
  EXPECT_EQ(result.active, (std::vector<char>{1, 1, 0}));
  EXPECT_NE(result.reason[2].find("40 % of the keyframes"), std::string::npos) << result.reason[2];
  EXPECT_EQ(result.forest.edges, (std::vector<int>{0, 1}));
}

TEST(CycleConsistency, CreditIsAskedOfEdgesInDisputeOnly) {
  const World w(3);
  const auto credit = [](int) -> double {
    ADD_FAILURE() << "all cycles are consistent";
    return 1;
  };
  FindConsistentForest(3, {w.Edge(0, 1, 9), w.Edge(1, 2, 8), w.Edge(0, 2, 3)}, {}, credit);
}

TEST(CycleConsistency, DisagreementWithinAnEdgesOwnUncertaintyIsTolerated) {
  const World w(3);
  CycleEdge loose = w.Edge(0, 2, 3, {30, 0, 0});
  EXPECT_EQ(FindConsistentForest(3, {w.Edge(0, 1, 9), w.Edge(1, 2, 8), loose}, {}).active[2], 0);
  loose.information = Matrix7d::Identity() / 25;  // 5 units of standard deviation in translation, radians in rotation
  EXPECT_EQ(FindConsistentForest(3, {w.Edge(0, 1, 9), w.Edge(1, 2, 8), loose}, {}).active[2], 1);
}

}  // namespace cycle_consistency_test
}  // namespace mapmend
