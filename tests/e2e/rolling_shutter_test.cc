// A camera that reads its images row by row bends a map of strips flown there and back; mapmend finds out how fast it
// reads, and straightens the map. 0.28 m if images are taken as read at once.

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/e2e/map_scenario.h"

namespace mapmend {
namespace rolling_shutter_test {

TEST(RollingShutter, IsFoundInARenderedFlightAndTakenOutOfItsMap) {
  const nlohmann::json summary = MapScenario("rolling_shutter");
  ASSERT_TRUE(summary.is_object());
  EXPECT_EQ(summary.at("frames_in_main"), 84);
  ASSERT_TRUE(summary.contains("readout_ms"));
  EXPECT_NEAR(summary.at("readout_ms").get<double>(), 30, 4);
  EXPECT_LE(summary.at("ate_rmse_m").get<double>(), 0.15);
}

}  // namespace rolling_shutter_test
}  // namespace mapmend
