#include "procs/frontend/index.h"

#include <gtest/gtest.h>

#include <type_traits>
#include <vector>

namespace mapmend {
namespace index_test {

template <typename A, typename B>
constexpr bool kEqualComparable = requires(A a, B b) {
  a == b;
};
template <typename A, typename B>
constexpr bool kLessComparable = requires(A a, B b) {
  a < b;
};

static_assert(std::is_constructible_v<PointIndex, int>);
static_assert(!std::is_convertible_v<int, PointIndex>);
static_assert(!std::is_assignable_v<PointIndex&, int>);

static_assert(std::is_assignable_v<PointIndex&, PointIndex>);
static_assert(!std::is_constructible_v<PointIndex, KeyframeIndex>);
static_assert(!std::is_convertible_v<KeyframeIndex, PointIndex>);
static_assert(!std::is_assignable_v<PointIndex&, KeyframeIndex>);
static_assert(!std::is_assignable_v<FeatureIndex&, PointIndex>);

static_assert(std::is_convertible_v<PointIndex, int>);

static_assert(kEqualComparable<PointIndex, PointIndex> && kLessComparable<PointIndex, PointIndex>);
static_assert(kEqualComparable<PointIndex, int> && kLessComparable<PointIndex, int>);
static_assert(!kEqualComparable<PointIndex, FeatureIndex> && !kLessComparable<PointIndex, FeatureIndex>);

static_assert(sizeof(PointIndex) == sizeof(int) && std::is_trivially_copyable_v<PointIndex>);

TEST(Index, IsNoneUntilItIsGiven) {
  EXPECT_TRUE(FeatureIndex().IsNone());
  EXPECT_EQ(FeatureIndex(), -1);
  EXPECT_FALSE(FeatureIndex(0).IsNone());
}

TEST(Index, IsASubscriptAndCounts) {
  const std::vector<int> squares = {0, 1, 4, 9};
  int sum = 0;
  for (PointIndex p(0); p < PointIndex(4); ++p) sum += squares[p];
  EXPECT_EQ(sum, 14);
  for (PointIndex p(3); !p.IsNone(); --p) sum -= squares[p];
  EXPECT_EQ(sum, 0);
}

}  // namespace index_test
}  // namespace mapmend
