#include "procs/frontend/profiler.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace profiler_test {

TEST(Profiler, TellsMedianAndThePercentileThatIsNotExceeded) {
  Profiler profiler;
  for (int i = 100; i >= 1; --i) profiler.Add("track/a", i);
  profiler.Add("map/b", 4);
  profiler.Add("map/b", 6);
  const std::vector<Profiler::Row> table = profiler.Table();
  ASSERT_EQ(table.size(), 2u);
  EXPECT_EQ(table[0].stage, "map/b");
  EXPECT_EQ(table[0].p95_ms, 6);  // never below the median
  EXPECT_EQ(table[1].frames, 100);
  EXPECT_EQ(table[1].median_ms, 51);
  EXPECT_EQ(table[1].p95_ms, 95);
  EXPECT_NEAR(table[1].total_s, 5.05, 1e-9);
}

}  // namespace profiler_test
}  // namespace mapmend
