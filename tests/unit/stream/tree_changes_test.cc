#include "libs/stream/tree_changes.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace tree_changes_test {

MergedTransforms WithEdges(const std::vector<std::pair<int, int>>& edges) {
  MergedTransforms transforms;
  for (int i = 0; i < 4; ++i)
    transforms.submaps.push_back({{i < 3 ? "11111111-one" : "22222222-two", SubmapId(i % 3)}, 0, {}, false});
  transforms.edges = edges;
  return transforms;
}

TEST(TreeChanges, TellsWhatJoinedAndWhatLeft) {
  TreeChanges tree;
  EXPECT_TRUE(tree.Update(WithEdges({})).empty());
  const auto first = tree.Update(WithEdges({{1, 0}}));
  ASSERT_EQ(first.size(), 1u);
  EXPECT_TRUE(first[0].joined);
  EXPECT_EQ(DescribePair(first[0]), "submap 0 and submap 1");
  EXPECT_TRUE(tree.Update(WithEdges({{0, 1}})).empty());  // the same edge, named the other way round
  const auto second = tree.Update(WithEdges({{0, 2}, {2, 3}}));
  ASSERT_EQ(second.size(), 3u);
  EXPECT_FALSE(second[0].joined);
  EXPECT_EQ(DescribePair(second[0]), "submap 0 and submap 1");
  EXPECT_TRUE(second[1].joined);
  EXPECT_EQ(DescribePair(second[2]), "submap 11111111:2 and submap 22222222:0");
}

}  // namespace tree_changes_test
}  // namespace mapmend
