#include "libs/base/sorted_map.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <string>

namespace mapmend {
namespace sorted_map_test {

TEST(SortedMap, IsAMap) {
  std::mt19937_64 random(3);
  SortedMap<int, std::string> map;
  std::map<int, std::string> expected;
  for (int round = 0; round < 2000; ++round) {
    const int key = static_cast<int>(random() % 200);
    switch (random() % 5) {
      case 0:
      case 1:
        map[key] = expected[key] = std::to_string(round);
        break;
      case 2: {  // at the end, as ids grow
        const int next = expected.empty() ? 0 : expected.rbegin()->first + 1;
        map[next] = expected[next] = std::to_string(round);
        break;
      }
      case 3:
        EXPECT_EQ(map.erase(key), expected.erase(key));
        break;
      default: {
        std::vector<int> keys;
        for (size_t i = 0; i < random() % 8; ++i) keys.push_back(static_cast<int>(random() % 200));
        map.EraseAll(keys);
        for (const int k : keys) expected.erase(k);
      }
    }
    ASSERT_EQ(map.size(), expected.size());
    ASSERT_TRUE(std::equal(map.begin(), map.end(), expected.begin(),
                           [](const auto& l, const auto& r) { return l.first == r.first && l.second == r.second; }));
    ASSERT_EQ(map.contains(key), expected.contains(key));
    ASSERT_EQ(map.find(key) == map.end(), !map.contains(key));
    const auto at = map.lower_bound(key);
    const auto expected_at = expected.lower_bound(key);
    ASSERT_EQ(at == map.end(), expected_at == expected.end());
    if (at != map.end()) {
      ASSERT_EQ(at->first, expected_at->first);
    }
  }
  EXPECT_GT(map.size(), 50u);
  EXPECT_THROW(map.at(-1), std::out_of_range);
  EXPECT_EQ(map.at(map.begin()->first), map.begin()->second);
}

}  // namespace sorted_map_test
}  // namespace mapmend
