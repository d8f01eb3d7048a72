#include "libs/features/corner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace mapmend {
namespace corner_test {

Corner MakeCorner(int x, int y, float strength) {
  return {static_cast<int16_t>(x), static_cast<int16_t>(y), 30, strength};
}

std::vector<float> Strengths(const std::vector<Corner>& corners) {
  std::vector<float> strengths;
  for (const Corner& c : corners) strengths.push_back(c.strength);
  return strengths;
}

TEST(SelectSpread, KeepsTheStrongestOfEachQuarter) {
  // Root 4 x 4 pixels, quarters of 2 x 2.
  const std::vector<Corner> corners = {MakeCorner(0, 0, 10), MakeCorner(1, 1, 30), MakeCorner(2, 0, 20),
                                       MakeCorner(3, 1, 20), MakeCorner(0, 3, 5),  MakeCorner(3, 3, 50),
                                       MakeCorner(2, 2, 49)};
  const std::vector<Corner> kept = SelectSpread(corners, 4, 1);
  EXPECT_EQ(Strengths(kept), (std::vector<float>{30, 20, 5, 50}));
  EXPECT_EQ(kept[1].x, 2);  // of equal ones the first in Morton order
  // Two nodes are not a level of a quadtree: four, of two corners each, of which the four strongest stay.
  EXPECT_EQ(Strengths(SelectSpread(corners, 4, 2)), (std::vector<float>{30, 20, 49, 50}));
  EXPECT_EQ(Strengths(SelectSpread(corners, 4, 4)), (std::vector<float>{30, 20, 49, 50}));
}

TEST(SelectSpread, FillsUpWithTheStrongestOthers) {
  // Two quarters; the left one has few, so the right one gives more than its share.
  std::vector<Corner> corners = {MakeCorner(0, 0, 1)};
  for (int i = 0; i < 8; ++i) corners.push_back(MakeCorner(64 + i, 0, static_cast<float>(10 + i)));
  EXPECT_EQ(Strengths(SelectSpread(corners, 4, 2)), (std::vector<float>{1, 15, 16, 17}));
}

TEST(Preselect, KeepsTheHighestScoresOfEachSquare) {
  // 1000 corners in a 100 x 100 image, ten wanted: squares of 31 pixels with about 90 corners each.
  std::vector<Corner> corners;
  for (int i = 0; i < 1000; ++i) {
    corners.push_back(
        {static_cast<int16_t>(i % 100), static_cast<int16_t>(i / 100 * 10), static_cast<int16_t>(i * 7 % 201)});
  }
  const std::vector<Corner> kept = Preselect(corners, 100, 100, 10);
  EXPECT_LE(kept.size(), 16u * 16u);
  EXPECT_GE(kept.size(), 100u);
  int lowest = 201, in_first_square = 0, better = 0;
  for (const Corner& c : kept) {
    if (c.x < 31 && c.y < 31) ++in_first_square, lowest = std::min<int>(lowest, c.score);
  }
  for (const Corner& c : corners) better += c.x < 31 && c.y < 31 && c.score > lowest;
  EXPECT_EQ(in_first_square, 16);
  EXPECT_LT(better, 16);
  EXPECT_EQ(Preselect(corners, 100, 100, 400).size(), 1000u);
}

TEST(Preselect, KeepsEnoughOfClusteredCorners) {
  std::vector<Corner> corners;
  for (int i = 0; i < 900; ++i) corners.push_back({static_cast<int16_t>(i % 30), static_cast<int16_t>(i / 30), 9});
  EXPECT_GE(Preselect(corners, 1000, 1000, 100).size(), 400u);
}

TEST(SelectSpread, GivesExactlyWhatIsWantedWhateverTheShape) {
  for (const auto& [width, height] : {std::pair(1000, 700), std::pair(3000, 3), std::pair(1, 2000)}) {
    std::vector<Corner> corners;
    uint32_t state = 1;
    for (int i = 0; i < 1500; ++i) {
      state = state * 1664525u + 1013904223u;
      const int16_t x = static_cast<int16_t>((state >> 8) % width), y = static_cast<int16_t>((state >> 4) % height);
      if (std::none_of(corners.begin(), corners.end(), [&](const Corner& c) { return c.x == x && c.y == y; })) {
        corners.push_back({x, y, 30, static_cast<float>(state >> 24)});
      }
    }
    for (const int wanted : {0, 1, 2, 3, 100, 333, 5000}) {
      EXPECT_EQ(SelectSpread(corners, wanted, 4).size(), std::min<size_t>(wanted, corners.size()))
          << width << " " << wanted;
    }
  }
}

TEST(SelectSpread, DoesNotDependOnTheOrderGiven) {
  std::vector<Corner> corners;
  for (int i = 0; i < 400; ++i) {
    corners.push_back(
        {static_cast<int16_t>(i * 37 % 401), static_cast<int16_t>(i * 53 % 307), 30, static_cast<float>(i % 9)});
  }
  const std::vector<Corner> a = SelectSpread(corners, 77, 3);
  std::reverse(corners.begin(), corners.end());
  const std::vector<Corner> b = SelectSpread(corners, 77, 3);
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) EXPECT_TRUE(a[i].x == b[i].x && a[i].y == b[i].y);
}

TEST(ShareOut, IsProportionalAndPassesOnWhatALevelLacks) {
  EXPECT_EQ(ShareOut({3, 2, 1}, {100, 100, 100}, 60), (std::vector<int>{30, 20, 10}));
  EXPECT_EQ(ShareOut({3, 2, 1}, {10, 100, 100}, 60), (std::vector<int>{10, 33, 17}));
  EXPECT_EQ(ShareOut({1, 1}, {3, 4}, 60), (std::vector<int>{3, 4}));
  EXPECT_EQ(ShareOut({1, 1, 1}, {0, 0, 0}, 10), (std::vector<int>{0, 0, 0}));
  const std::vector<int> thirds = ShareOut({1, 1, 1}, {9, 9, 9}, 10);
  EXPECT_EQ(std::accumulate(thirds.begin(), thirds.end(), 0), 10);
}

}  // namespace corner_test
}  // namespace mapmend
