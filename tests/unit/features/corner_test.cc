#include "libs/features/corner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace mapmend {
namespace {

TEST(SelectSpread, KeepsTheBestOfEachQuarter) {
  // Root 4 x 4 pixels; one corner wanted per quarter of 2 x 2.
  const std::vector<Corner> corners = {{0, 0, 10}, {1, 1, 30}, {2, 0, 20}, {3, 1, 20},
                                       {0, 3, 5},  {3, 3, 50}, {2, 2, 49}};
  const std::vector<Corner> kept = SelectSpread(corners, 4);
  ASSERT_EQ(kept.size(), 4u);
  EXPECT_EQ(kept[0].score, 30);
  EXPECT_EQ(kept[1].x, 2);  // tie of scores: smaller y
  EXPECT_EQ(kept[1].y, 0);
  EXPECT_EQ(kept[2].score, 5);
  EXPECT_EQ(kept[3].score, 50);
}

TEST(SelectSpread, GivesExactlyWhatIsWantedWhateverTheShape) {
  for (const auto& [width, height] : {std::pair(1000, 700), std::pair(3000, 3), std::pair(1, 2000)}) {
    std::vector<Corner> corners;
    uint32_t state = 1;
    for (int i = 0; i < 1500; ++i) {
      state = state * 1664525u + 1013904223u;
      const int16_t x = static_cast<int16_t>((state >> 8) % width), y = static_cast<int16_t>((state >> 4) % height);
      if (std::none_of(corners.begin(), corners.end(), [&](const Corner& c) { return c.x == x && c.y == y; })) {
        corners.push_back({x, y, static_cast<uint8_t>(state >> 24)});
      }
    }
    for (const int wanted : {0, 1, 2, 3, 100, 333, 5000}) {
      EXPECT_EQ(SelectSpread(corners, wanted).size(), std::min<size_t>(wanted, corners.size()))
          << width << " " << wanted;
    }
  }
}

TEST(SelectSpread, DoesNotDependOnTheOrderGiven) {
  std::vector<Corner> corners;
  for (int i = 0; i < 400; ++i) {
    corners.push_back(
        {static_cast<int16_t>(i * 37 % 401), static_cast<int16_t>(i * 53 % 307), static_cast<uint8_t>(i % 9)});
  }
  const std::vector<Corner> a = SelectSpread(corners, 77);
  std::reverse(corners.begin(), corners.end());
  const std::vector<Corner> b = SelectSpread(corners, 77);
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

}  // namespace
}  // namespace mapmend
