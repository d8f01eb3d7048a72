#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "libs/connecting/connection_strength.h"
#include "libs/connecting/kruskal.h"
#include "libs/connecting/merged_transforms.h"

namespace mapmend {
namespace graph_test {

TEST(ConnectionStrength, IsEquationThree) {
  EXPECT_DOUBLE_EQ(ConnectionStrength(0, 0, 0), 0);
  EXPECT_DOUBLE_EQ(ConnectionStrength(3, 120, 20), 3 + 12 + 40);
  EXPECT_DOUBLE_EQ(ConnectionStrength(1, 50, 45), 1 + 5 + 202.5);
}

TEST(ConnectionStrength, AngleBeyond45DegreesAddsNothing) {
  EXPECT_DOUBLE_EQ(ConnectionStrength(2, 10, 80), ConnectionStrength(2, 10, 45));
}

TEST(Kruskal, TakesTheStrongestEdgesThatCloseNoCycle) {
  // Triangle 0-1-2 and a pendant 3; vertex 4 is alone.
  const std::vector<WeightedEdge> edges = {{0, 1, 5}, {1, 2, 9}, {0, 2, 7}, {3, 2, 1}};
  const SpanningForest forest = MaximumSpanningForest(5, edges);
  EXPECT_EQ(forest.edges, (std::vector<int>{1, 2, 3}));
  EXPECT_EQ(forest.component, (std::vector<int>{0, 0, 0, 0, 1}));
  EXPECT_EQ(forest.num_components, 2);
}

TEST(Kruskal, TiesGoToTheLowerIndex) {
  EXPECT_EQ(MaximumSpanningForest(3, {{0, 1, 1}, {1, 2, 1}, {2, 0, 1}}).edges, (std::vector<int>{0, 1}));
}

TEST(Kruskal, ComponentsAreNumberedByTheirLowestVertex) {
  EXPECT_EQ(MaximumSpanningForest(5, {{4, 1, 1}, {2, 3, 1}}).component, (std::vector<int>{0, 1, 2, 2, 1}));
}

// Best total weight among all subsets of edges that are forests with as few components as possible.
double ExhaustiveMaximum(int n, const std::vector<WeightedEdge>& edges, size_t* num_edges) {
  double best = 0;
  *num_edges = 0;
  for (unsigned subset = 0; subset < (1u << edges.size()); ++subset) {
    std::vector<int> label(n);
    for (int v = 0; v < n; ++v) label[v] = v;
    double weight = 0;
    size_t count = 0;
    bool is_forest = true;
    for (size_t i = 0; i < edges.size() && is_forest; ++i) {
      if (!(subset >> i & 1)) continue;
      const int a = label[edges[i].a], b = label[edges[i].b];
      is_forest = a != b;
      for (int& l : label) l = l == b ? a : l;
      weight += edges[i].weight;
      ++count;
    }
    if (is_forest && std::pair(count, weight) > std::pair(*num_edges, best)) {
      *num_edges = count;
      best = weight;
    }
  }
  return best;
}

TEST(Kruskal, ForestIsMaximalAgainstExhaustiveSearch) {
  std::mt19937_64 random(11);
  for (int trial = 0; trial < 200; ++trial) {
    const int n = 2 + static_cast<int>(random() % 5);
    std::vector<WeightedEdge> edges;
    for (int a = 0; a < n; ++a) {
      for (int b = a + 1; b < n; ++b) {
        if (random() % 3) edges.push_back({a, b, static_cast<double>(1 + random() % 9)});
      }
    }
    const SpanningForest forest = MaximumSpanningForest(n, edges);
    double weight = 0;
    for (const int i : forest.edges) weight += edges[i].weight;
    size_t num_edges = 0;
    EXPECT_DOUBLE_EQ(weight, ExhaustiveMaximum(n, edges, &num_edges));
    EXPECT_EQ(forest.edges.size(), num_edges);
    EXPECT_EQ(static_cast<size_t>(forest.num_components), n - num_edges);
  }
}

TEST(ComposeAlongForest, PlacesEveryVertexInTheFrameOfTheOldest) {
  // Known places of four vertices in one world; edges carry the relative transforms, in both directions of writing.
  const auto at = [](double scale, double angle, double x) {
    return Similarity3(scale, Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ())), {x, 2 * x, 1});
  };
  const std::vector<Similarity3> world_from = {at(1, 0, 0), at(2, 1, 3), at(0.5, -2, 5), at(4, 0.3, -1), at(1, 0, 9)};
  const auto edge = [&](int a, int b) { return TreeEdge{a, b, world_from[b].Inverse() * world_from[a]}; };
  const std::vector<MergedPlace> places = ComposeAlongForest(5, {edge(2, 0), edge(2, 3), edge(3, 1)});
  for (int v = 0; v < 4; ++v) {
    EXPECT_EQ(places[v].root, 0);
    const Similarity3 expected = world_from[0].Inverse() * world_from[v];
    EXPECT_NEAR(places[v].root_from_vertex.scale, expected.scale, 1e-12);
    const Eigen::Vector3d x(1, -2, 3);
    EXPECT_LT((places[v].root_from_vertex * x - expected * x).norm(), 1e-9);
  }
  EXPECT_EQ(places[1].depth, 3);
  EXPECT_EQ(places[1].parent, 3);
  EXPECT_EQ(places[4].root, 4);
}

TEST(ComposeAlongForest, WhatWasRefinedTogetherKeepsItsPlacesAndTheRestFollows) {
  const auto shift = [](double x) { return Similarity3(1, Eigen::Quaterniond::Identity(), {x, 0, 0}); };
  // A chain 0 - 1 - 2 - 3, each a unit on by its edge; 0 to 2 were refined to lie 1.5 apart.
  const std::vector<TreeEdge> chain = {{1, 0, shift(1)}, {2, 1, shift(1)}, {3, 2, shift(1)}};
  const std::vector<RefinedPlace> refined = {{7, shift(10)}, {7, shift(11.5)}, {7, shift(13)}, {}};
  const std::vector<MergedPlace> places = ComposeAlongForest(4, chain, refined);
  EXPECT_DOUBLE_EQ(places[0].root_from_vertex.translation.x(), 0);
  EXPECT_DOUBLE_EQ(places[1].root_from_vertex.translation.x(), 1.5);
  EXPECT_DOUBLE_EQ(places[2].root_from_vertex.translation.x(), 3);
  EXPECT_DOUBLE_EQ(places[3].root_from_vertex.translation.x(), 4);  // by its edge from where 2 lies now

  // Without the edge 0 - 1 the group falls apart: 1 is the root of what is left, 2 keeps its distance from it.
  const std::vector<MergedPlace> apart = ComposeAlongForest(4, {{2, 1, shift(1)}, {3, 2, shift(1)}}, refined);
  EXPECT_EQ(apart[1].root, 1);
  EXPECT_DOUBLE_EQ(apart[1].root_from_vertex.translation.x(), 0);
  EXPECT_DOUBLE_EQ(apart[2].root_from_vertex.translation.x(), 1.5);
}

}  // namespace graph_test
}  // namespace mapmend
