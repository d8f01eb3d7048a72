#include "libs/connecting/window_matching.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace mapmend {
namespace window_matching_test {

constexpr double kFactor = 1.2;

PooledMatch MatchAt(int point, double log_scale, double turn, int distance, int votes) {
  PooledMatch m;
  m.point_a = m.point_b = MapPointId(point);
  m.log_scale = log_scale;
  m.turn = turn;
  m.distance = distance;
  m.votes = votes;
  return m;
}

// 60 matches by chance, most of them near equal size, and 6 good ones where the one image shows things four times
// larger, their turn about half a circle.
std::vector<PooledMatch> FewAmongMany() {
  std::mt19937_64 random(3);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  std::vector<PooledMatch> matches;
  for (int i = 0; i < 60; ++i) matches.push_back(MatchAt(i, uniform(-0.8, 0.8), uniform(-M_PI, M_PI), 55, 1));
  for (int i = 0; i < 6; ++i)
    matches.push_back(MatchAt(100 + i, -1.3 + 0.04 * i, (i % 2 ? 1 : -1) * (M_PI - 0.05 * i), 30, 3));
  return matches;
}

TEST(TakeAgreeing, FindsFewGoodMatchesAtAFarScale) {
  std::vector<PooledMatch> matches = FewAmongMany();
  const std::vector<PooledMatch> agreed = TakeAgreeing({}, kFactor, &matches);
  ASSERT_EQ(agreed.size(), 6u);
  for (const PooledMatch& m : agreed) EXPECT_GE(m.point_a.value, 100);
  EXPECT_EQ(matches.size(), 60u);
}

TEST(TakeAgreeing, TheNextCallTakesTheNextBest) {
  std::vector<PooledMatch> matches = FewAmongMany();
  TakeAgreeing({}, kFactor, &matches);
  const std::vector<PooledMatch> next = TakeAgreeing({}, kFactor, &matches);
  ASSERT_FALSE(next.empty());
  for (const PooledMatch& m : next) {
    EXPECT_LT(m.point_a.value, 100);
    EXPECT_LE(std::abs(m.log_scale - next.front().log_scale), 2 * 1.5 * std::log(kFactor) + 1e-12);
  }
  EXPECT_EQ(matches.size() + next.size(), 60u);
}

TEST(TakeAgreeing, OfNothingComesNothing) {
  std::vector<PooledMatch> none;
  EXPECT_TRUE(TakeAgreeing({}, kFactor, &none).empty());
}

}  // namespace window_matching_test
}  // namespace mapmend
