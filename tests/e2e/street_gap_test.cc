// A car drives on for 28 m in which the camera sees nothing: what ORB cannot connect, wide features do.

#include <gtest/gtest.h>

#include "tests/e2e/map_scenario.h"

namespace mapmend {
namespace street_gap_test {

TEST(StreetGap, IsBridgedByWideFeatures) {
  const nlohmann::json summary = MapScenario("street_gap");
  ASSERT_FALSE(summary.is_null());
  EXPECT_GE(summary["submaps"].size(), 2u) << "the gap tears the map";
  ASSERT_EQ(summary["components"].size(), 1u) << summary["connections"].dump(1);
  int num_wide = 0;
  for (const nlohmann::json& c : summary["connections"]) num_wide += c["in_tree"] == true && c["kind"] == "wide";
  EXPECT_GE(num_wide, 1) << summary["connections"].dump(1);
  const nlohmann::json& main = summary["components"][0];
  EXPECT_GE(main["frames"], 120);
  EXPECT_LT(main["ate_rmse_m"], 1.0) << "of 100 m driven";
}

}  // namespace street_gap_test
}  // namespace mapmend
