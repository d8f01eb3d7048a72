// Five seconds that show next to nothing, between two stretches that see the same ground: what is not recognised is
// placed by how the camera moved.

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

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
  // The other strip shows nearly all of the same ground, and better.
  const cv::Mat mosaic = cv::imread(run.out + "/mosaic.png", cv::IMREAD_COLOR);
  ASSERT_FALSE(mosaic.empty());
  cv::Mat is_white;
  cv::inRange(mosaic, cv::Scalar::all(200), cv::Scalar::all(254), is_white);
  EXPECT_LT(cv::countNonZero(is_white), 0.03 * static_cast<double>(mosaic.total()));
}

}  // namespace overexposed_test
}  // namespace mapmend
