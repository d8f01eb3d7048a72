#include "libs/base/compact_vector.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace mapmend {
namespace compact_vector_test {

struct Element {
  int32_t number = 7;
  float value = 0.5f;
  bool operator==(const Element&) const = default;
};

TEST(CompactVector, IsAVectorOfEightBytes) {
  EXPECT_EQ(sizeof(CompactVector<Element>), 8u);
  std::mt19937_64 random(11);
  CompactVector<Element> vector;
  std::vector<Element> expected;
  for (int round = 0; round < 3000; ++round) {
    const Element element{static_cast<int32_t>(random() % 20), static_cast<float>(round)};
    const auto at = static_cast<long>(random() % (expected.size() + 1));
    switch (random() % 4) {
      case 0:
        vector.insert(vector.begin() + at, element);
        expected.insert(expected.begin() + at, element);
        break;
      case 1:
        vector.push_back(element);
        expected.push_back(element);
        break;
      case 2: {
        const auto is_erased = [&](const Element& e) { return e.number == element.number; };
        vector.EraseIf(is_erased);
        std::erase_if(expected, is_erased);
        break;
      }
      default:
        vector = CompactVector<Element>(random() % 3);
        expected = std::vector<Element>(vector.size());
    }
    ASSERT_EQ(vector.size(), expected.size());
    ASSERT_EQ(vector.empty(), expected.empty());
    ASSERT_TRUE(std::equal(vector.begin(), vector.end(), expected.begin(), expected.end()));
    if (!expected.empty()) {
      EXPECT_EQ(vector.front(), expected.front());
      EXPECT_EQ(vector.back(), expected.back());
    }
  }
}

TEST(CompactVector, ACopyIsItsOwnAndWhatWasMovedIsEmpty) {
  CompactVector<Element> first(2);
  CompactVector<Element> second = first;
  EXPECT_TRUE(first == second);
  second[1].number = 3;
  EXPECT_EQ(first[1].number, 7);
  EXPECT_FALSE(first == second);
  const CompactVector<Element> third = std::move(second);
  EXPECT_EQ(third[1].number, 3);
  EXPECT_TRUE(second.empty());  // NOLINT(bugprone-use-after-move)
  second = third;
  second.insert(second.begin(), second[1]);  // an element of its own
  EXPECT_EQ(second.front().number, 3);
  EXPECT_EQ(second.size(), 3u);
}

}  // namespace compact_vector_test
}  // namespace mapmend
