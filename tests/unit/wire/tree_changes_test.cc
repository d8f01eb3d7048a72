#include "libs/wire/tree_changes.h"

#include <gtest/gtest.h>

#include <mapmend/merged_transforms_t.hpp>

namespace mapmend {
namespace {

merged_transforms_t Message(const std::vector<std::pair<int, int>>& edges) {
  merged_transforms_t message{};
  for (int i = 0; i < 4; ++i) {
    merged_submap_t submap{};
    submap.session = i < 3 ? "11111111-one" : "22222222-two";
    submap.submap = i % 3;
    message.submaps.push_back(submap);
  }
  for (const auto& [a, b] : edges) {
    message.edge_a.push_back(a);
    message.edge_b.push_back(b);
  }
  return message;
}

TEST(TreeChanges, TellsWhatJoinedAndWhatLeft) {
  TreeChanges tree;
  EXPECT_TRUE(tree.Update(Message({})).empty());
  const auto first = tree.Update(Message({{1, 0}}));
  ASSERT_EQ(first.size(), 1u);
  EXPECT_TRUE(first[0].joined);
  EXPECT_EQ(DescribePair(first[0]), "submap 0 and submap 1");
  EXPECT_TRUE(tree.Update(Message({{0, 1}})).empty());  // the same edge, named the other way round
  const auto second = tree.Update(Message({{0, 2}, {2, 3}}));
  ASSERT_EQ(second.size(), 3u);
  EXPECT_FALSE(second[0].joined);
  EXPECT_EQ(DescribePair(second[0]), "submap 0 and submap 1");
  EXPECT_TRUE(second[1].joined);
  EXPECT_EQ(DescribePair(second[2]), "submap 11111111:2 and submap 22222222:0");
}

TEST(TreeChanges, EdgesOutOfRangeAreLeftOut) {
  TreeChanges tree;
  EXPECT_TRUE(tree.Update(Message({{0, 7}, {-1, 2}})).empty());
}

}  // namespace
}  // namespace mapmend
