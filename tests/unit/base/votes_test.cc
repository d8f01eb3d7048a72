#include "libs/base/votes.h"

#include <gtest/gtest.h>

#include <map>
#include <random>

namespace mapmend {
namespace votes_test {

TEST(Votes, RankByNumberThenByKey) {
  std::mt19937_64 random(5);
  Votes<std::pair<int, int>> votes;
  std::map<std::pair<int, int>, int> expected;
  for (int i = 0; i < 20000; ++i) {
    // Few keys get many of the votes, most get one.
    const std::pair<int, int> key(static_cast<int>(random() % 3), static_cast<int>(random() % (i % 5 ? 10 : 5000)));
    votes.Add(key);
    ++expected[key];
  }
  const auto ranked = votes.TakeRanked();
  ASSERT_EQ(ranked.size(), expected.size());
  for (size_t i = 0; i < ranked.size(); ++i) {
    EXPECT_EQ(ranked[i].second, expected.at(ranked[i].first));
    if (i == 0) continue;
    EXPECT_LT(std::pair(-ranked[i - 1].second, ranked[i - 1].first), std::pair(-ranked[i].second, ranked[i].first));
  }
  EXPECT_TRUE(votes.TakeRanked().empty());
}

}  // namespace votes_test
}  // namespace mapmend
