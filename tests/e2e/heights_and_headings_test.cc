// Submaps that see the same ground from other headings and heights find each other: rendered flights, cut where they
// turn and climb.

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/e2e/map_scenario.h"

namespace mapmend {
namespace heights_and_headings_test {

// The connection of two submaps, null if they were never compared.
nlohmann::json Between(const nlohmann::json& summary, int a, int b) {
  for (const nlohmann::json& c : summary.at("connections")) {
    if (c.at("a") == a && c.at("b") == b) return c;
  }
  return nullptr;
}

void ExpectAccepted(const nlohmann::json& summary, int a, int b) {
  const nlohmann::json connection = Between(summary, a, b);
  ASSERT_FALSE(connection.is_null()) << a << " and " << b;
  EXPECT_EQ(connection.at("verdict"), "accepted") << a << " and " << b << ": " << connection.at("reason");
  EXPECT_GE(connection.at("F"), 3) << connection.at("reason");
}

TEST(HeightsAndHeadings, StripsAtRightAnglesOppositeAndTwiceAsHighAreConnected) {
  const nlohmann::json summary = MapScenario("heights_and_headings");
  ASSERT_TRUE(summary.is_object());
  ASSERT_EQ(summary.at("submaps").size(), 4u);
  ExpectAccepted(summary, 0, 1);  // 90 degrees
  ExpectAccepted(summary, 0, 2);  // 180 degrees
  ExpectAccepted(summary, 0, 3);  // 90 degrees, and twice the height
  ExpectAccepted(summary, 1, 3);  // twice the height
  EXPECT_EQ(summary.at("components").size(), 1u);
  EXPECT_GE(summary.at("frames_in_main"), 90);
  EXPECT_LE(summary.at("ate_rmse_m"), 0.6);
}

TEST(HeightsAndHeadings, AStripFourTimesAsHighIsConnected) {
  const nlohmann::json summary = MapScenario("climb_short");
  ASSERT_TRUE(summary.is_object());
  ASSERT_EQ(summary.at("submaps").size(), 2u);
  ExpectAccepted(summary, 0, 1);
  EXPECT_EQ(summary.at("components").size(), 1u);
  EXPECT_GE(summary.at("frames_in_main"), 57);
  EXPECT_LE(summary.at("ate_rmse_m"), 1.2);
}

}  // namespace heights_and_headings_test
}  // namespace mapmend
