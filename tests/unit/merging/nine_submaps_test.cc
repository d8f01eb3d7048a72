#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "libs/connecting/connection_strength.h"
#include "libs/connecting/kruskal.h"
#include "libs/connecting/merged_transforms.h"

// Nine submaps, sixteen connections that become known one after the other, as in the paper's worked example (its Figure
// 5 and Table 1). The numbers are our own: the paper's table was not at hand. Worked out by hand: after each
// connection, L1 holds those in the tree and L2 those off it, both strongest first.
namespace mapmend {
namespace {

struct Row {
  char name;  // of the connection that becomes known
  int a, b;   // submaps, from 1
  int F, M;
  double theta, C;  // C = F + 0.1 M + 0.1 theta^2
  const char* L1;
  const char* L2;
  int num_components;  // of the nine
};

const Row kRows[] = {
    {'a', 1, 2, 2, 20, 10, 14.0, "a", "", 8},
    {'b', 2, 3, 3, 60, 0, 9.0, "ab", "", 7},
    {'c', 1, 3, 1, 0, 10, 11.0, "ac", "b", 7},    // closes 1-2-3: b is the weakest
    {'d', 4, 5, 2, 50, 0, 7.0, "acd", "b", 6},    // a second tree
    {'e', 3, 4, 1, 40, 0, 5.0, "acde", "b", 5},   // joins the two
    {'f', 1, 4, 3, 50, 0, 8.0, "acfd", "be", 5},  // a stronger joint than e
    {'g', 5, 6, 2, 10, 10, 13.0, "agcfd", "be", 4},
    {'h', 4, 6, 2, 40, 0, 6.0, "agcfd", "bhe", 4},  // closes 4-5-6 and is its weakest
    {'i', 6, 7, 1, 30, 0, 4.0, "agcfdi", "bhe", 3},
    {'j', 8, 9, 4, 60, 0, 10.0, "agcjfdi", "bhe", 2},       // 8 and 9 are a map of their own
    {'k', 7, 8, 1, 20, 0, 3.0, "agcjfdik", "bhe", 1},       // all in one
    {'l', 5, 8, 2, 50, 5, 9.5, "agcjlfdi", "bhek", 1},      // closes 5-6-7-8: k goes
    {'m', 9, 1, 1, 10, 0, 2.0, "agcjlfdi", "bhekm", 1},     // closes 1-4-5-8-9 and is its weakest
    {'n', 7, 9, 1, 10, 10, 12.0, "agncjlfd", "bheikm", 1},  // closes 5-6-7-9-8: i goes
    {'o', 2, 9, 2, 40, 5, 8.5, "agncjlof", "bdheikm", 1},   // closes 1-4-5-8-9-2: d goes
    {'p', 3, 6, 3, 43, 5, 9.8, "agncjplf", "bodheikm", 1},  // closes 1-2-9-8-5-6-3: o goes
};

TEST(NineSubmaps, EachNewConnectionLeavesTheStrongestTree) {
  std::vector<WeightedEdge> edges;
  SpanningForest forest;
  for (const Row& row : kRows) {
    SCOPED_TRACE(row.name);
    const double strength = ConnectionStrength(row.F, row.M, row.theta);
    EXPECT_DOUBLE_EQ(strength, row.C);
    edges.push_back({row.a - 1, row.b - 1, strength});
    forest = MaximumSpanningForest(9, edges);

    std::string tree;
    std::vector<int> rest(edges.size());
    for (size_t i = 0; i < rest.size(); ++i) rest[i] = static_cast<int>(i);
    for (const int e : forest.edges) {
      tree += kRows[e].name;
      std::erase(rest, e);
    }
    std::stable_sort(rest.begin(), rest.end(), [&](int l, int r) { return edges[l].weight > edges[r].weight; });
    std::string off_the_tree;
    for (const int e : rest) off_the_tree += kRows[e].name;
    EXPECT_EQ(tree, row.L1);
    EXPECT_EQ(off_the_tree, row.L2);
    EXPECT_EQ(forest.num_components, row.num_components);
  }

  // The tree from submap 1, the oldest: 1 - 2, 1 - 3 - 6 - 5 - 8 - 9 - 7, 1 - 4.
  std::vector<TreeEdge> tree;
  for (const int e : forest.edges) tree.push_back({edges[e].a, edges[e].b, Similarity3()});
  const std::vector<MergedPlace> places = ComposeAlongForest(9, tree);
  std::vector<int> parents, depths;
  for (const MergedPlace& place : places) {
    EXPECT_EQ(place.root, 0);
    parents.push_back(place.parent + 1);
    depths.push_back(place.depth);
  }
  EXPECT_EQ(parents, (std::vector<int>{0, 1, 1, 1, 6, 3, 9, 5, 8}));
  EXPECT_EQ(depths, (std::vector<int>{0, 1, 1, 1, 3, 2, 6, 4, 5}));
}

}  // namespace
}  // namespace mapmend
