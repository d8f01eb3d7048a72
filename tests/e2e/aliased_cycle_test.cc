// Perceptual aliasing in a rendered flight: where the first of four strips begins and where the third begins, 180 m
// apart, the land looks the same. The connection that this brings about closes a cycle with the true ones, and is found
// out.

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/e2e/map_scenario.h"

namespace mapmend {
namespace aliased_cycle_test {

TEST(AliasedCycle, TheWrongConnectionIsDeactivatedAndTheMapIsRight) {
  const nlohmann::json summary = MapScenario("aliased_cycle");
  ASSERT_TRUE(summary.is_object());
  ASSERT_EQ(summary.at("submaps").size(), 4u);
  bool is_caught = false;
  for (const nlohmann::json& c : summary.at("connections")) {
    const bool is_aliased = c.at("a") == 0 && c.at("b") == 2;
    if (!is_aliased) {
      EXPECT_NE(c.at("verdict"), "deactivated") << c.at("reason");
      continue;
    }
    is_caught = true;
    EXPECT_GE(c.at("F"), 3);  // the images alone speak for it
    EXPECT_EQ(c.at("verdict"), "deactivated");
    EXPECT_FALSE(c.at("in_tree"));
    EXPECT_NE(c.at("reason").get<std::string>().find("going round a cycle"), std::string::npos) << c.at("reason");
  }
  EXPECT_TRUE(is_caught);
  EXPECT_EQ(summary.at("components").size(), 1u);
  EXPECT_GE(summary.at("frames_in_main"), 120);
  EXPECT_LE(summary.at("ate_rmse_m"), 0.5);  // with the wrong connection: some 80 m
}

}  // namespace aliased_cycle_test
}  // namespace mapmend
