// Submaps that see the same ground from other headings and heights find each other: rendered flights, cut where they
// turn and climb.

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";

// Renders a scenario and maps it; the summary, null if that failed.
nlohmann::json MapScenario(const std::string& scenario) {
  const TemporaryFolder folder;
  const std::string flight = folder / "flight", out = folder / "out";
  const CommandResult rendered =
      RunCommand({kProgram, "simulate", "--quiet", "--scenario", scenario, "--out", flight}, 120);
  EXPECT_EQ(rendered.exit_code, 0) << rendered.output;
  const CommandResult run = RunCommand(
      {kProgram, "run", flight + "/video.mp4", "--camera", flight + "/camera.yaml", "--times", flight + "/times.txt",
       "--groundtruth", flight + "/groundtruth.tum", "--out", out, "--port", "0", "--seed", "1"},
      240);
  EXPECT_EQ(run.exit_code, 0) << run.output;
  if (rendered.exit_code != 0 || run.exit_code != 0) return nullptr;
  return nlohmann::json::parse(ReadText(out + "/summary.json"));
}

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

}  // namespace
}  // namespace mapmend
