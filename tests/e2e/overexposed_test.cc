// Five seconds that show next to nothing, between two stretches that see the same ground: what is not recognised is
// placed by how the camera moved.

#include <gtest/gtest.h>

#include "tests/e2e/map_scenario.h"

namespace mapmend {
namespace overexposed_test {

TEST(Overexposed, StretchBetweenJoinedOnesIsPlacedByMotion) {
  const ScenarioRun run("overexposed");
  ASSERT_FALSE(run.summary.is_null());
  EXPECT_GE(run.summary["submaps"].size(), 3u) << "before, within and after";
  ASSERT_EQ(run.summary["components"].size(), 1u) << run.summary["connections"].dump(1);
  int num_motion = 0;
  for (const nlohmann::json& c : run.summary["connections"])
    num_motion += c["verdict"] == "accepted" && c["kind"] == "motion";
  EXPECT_EQ(num_motion, 2) << run.summary["connections"].dump(1);
  const nlohmann::json& main = run.summary["components"][0];
  EXPECT_GE(main["frames"], 140) << "of 150";
  EXPECT_LT(main["ate_rmse_m"], 0.5) << "from 75 m above";
  EXPECT_LT(main["ate_max_m"], 1.5) << "2 % of that";
}

}  // namespace overexposed_test
}  // namespace mapmend
