// The parts of libs/base that fit into a header, or nearly so.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <set>

#include "libs/base/backoff.h"
#include "libs/base/checksum.h"
#include "libs/base/median.h"
#include "libs/base/random.h"
#include "libs/base/text_format.h"

namespace mapmend {
namespace small_parts_test {

using std::chrono::milliseconds;

TEST(Backoff, DoublesUpToALimitGiveOrTakeAQuarter) {
  Backoff backoff(milliseconds(100), milliseconds(500));
  for (const int expected : {100, 200, 400, 500, 500}) {
    const auto wait = backoff.Next().count();
    EXPECT_GE(wait, 3 * expected / 4);
    EXPECT_LE(wait, 5 * expected / 4);
  }
  backoff.Reset();
  EXPECT_LE(backoff.Next().count(), 125);
}

TEST(Checksum, IsTheCrcOfZlib) {
  EXPECT_EQ(Crc32("123456789", 9), 0xcbf43926u);  // the check value of CRC-32
  EXPECT_EQ(Crc32("6789", 4, Crc32("12345", 5)), 0xcbf43926u);
}

TEST(Checksum, OfARecordTellsChannelsApart) {
  const uint8_t data[] = {'x', 1};
  EXPECT_EQ(RecordChecksum("AB", data, 2), Crc32("AB\0x\1", 5));
  EXPECT_NE(RecordChecksum("A", data, 2), RecordChecksum("B", data, 2));
}

TEST(Median, IsTheUpperOfTheMiddleValues) {
  EXPECT_EQ(Median({}), 0);
  EXPECT_EQ(Median({3}), 3);
  EXPECT_EQ(Median({5, 1, 3}), 3);
  EXPECT_EQ(Median({4, 1, 3, 2}), 3);
}

TEST(Random, TheSameSeedGivesTheSameNumbers) {
  // The first numbers of SplitMix64 with the seed 0, as its authors' code prints them.
  Random random(0);
  EXPECT_EQ(random.Next(), 0xe220a8397b1dcdafULL);
  EXPECT_EQ(random.Next(), 0x6e789e6aa1b965f4ULL);
  EXPECT_NE(Random(1).Next(), Random(2).Next());
}

TEST(Random, StaysWithinItsBoundsAndReachesThem) {
  Random random(7);
  std::set<int> seen;
  for (int i = 0; i < 200; ++i) {
    seen.insert(random.Below(5));
    const double uniform = random.Uniform();
    EXPECT_GE(uniform, 0);
    EXPECT_LT(uniform, 1);
  }
  EXPECT_EQ(seen, (std::set<int>{0, 1, 2, 3, 4}));
}

TEST(Random, ShufflingKeepsAllValues) {
  Random random(3);
  std::vector<int> values(50);
  for (int i = 0; i < 50; ++i) values[static_cast<size_t>(i)] = i;
  const std::vector<int> before = values;
  random.Shuffle(&values);
  EXPECT_NE(values, before);
  EXPECT_TRUE(std::is_permutation(values.begin(), values.end(), before.begin()));
}

TEST(Format, IsPrintfInAString) { EXPECT_EQ(Format("%d of %.1f m", 3, 2.25), "3 of 2.2 m"); }

}  // namespace small_parts_test
}  // namespace mapmend
