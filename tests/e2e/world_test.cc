// The bundled flight with its raw positions: where its parts lie on the earth, in whatever frame they are written.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "libs/geometry/trajectory_file.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace world_test {

using Json = nlohmann::json;

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

class World : public testing::Test {
 protected:
  static CommandResult Run(const std::string& skip, const std::string& out, const std::vector<std::string>& more = {}) {
    std::vector<std::string> argv = {kProgram,
                                     "run",
                                     kFlight + "video.mp4",
                                     "--gps",
                                     kFlight + "exif.csv",
                                     "--skip-frames",
                                     skip,
                                     "--groundtruth",
                                     kFlight + "groundtruth.tum",
                                     "--out",
                                     out,
                                     "--port",
                                     "0"};
    argv.insert(argv.end(), more.begin(), more.end());
    return RunCommand(argv, 900);
  }
  static Json Summary(const std::string& out) { return Json::parse(ReadText(out + "/summary.json")); }
  // Largest distance of a trajectory in east, north, up from the ground truth, horizontally, nothing aligned.
  static double LargestError(const std::string& file) {
    const Trajectory truth = ReadTrajectory(kFlight + "groundtruth.tum");
    double largest = 0;
    for (const StampedPose& pose : ReadTrajectory(file)) {
      for (const StampedPose& t : truth) {
        if (t.utime != pose.utime) continue;
        const Eigen::Vector3d off = pose.world_from_camera.translation - t.world_from_camera.translation;
        largest = std::max(largest, off.head<2>().norm());
      }
    }
    return largest;
  }

  TemporaryFolder folder_;
};

TEST_F(World, TheWholeFlightLiesOnItsPositions) {
  const std::string out = folder_ / "run";
  const CommandResult result = Run("74-83", out, {"--frame", "enu"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_NE(result.output.find("172 positions (table"), std::string::npos) << result.output;
  EXPECT_NE(result.output.find("on earth"), std::string::npos) << result.output;
  const Json world = Summary(out).at("world");
  const Json& main = world.at("components").at(0);
  ASSERT_TRUE(main.at("placed"));
  EXPECT_LE(main.at("horizontal_residual_median_m"), 1.5);
  EXPECT_LE(main.at("groundtruth").at("horizontal_rmse_m"), 1.5);
  EXPECT_TRUE(main.at("open").empty());
  EXPECT_EQ(world.at("clocks").at(0).at("offset_s"), 0);
  EXPECT_EQ(world.at("utm").at("epsg"), 32617);
  EXPECT_LE(LargestError(out + "/frames.tum"), 3);

  // The map is the same in another frame, and again.
  const std::string before = ReadText(out + "/frames.tum");
  ASSERT_EQ(RunCommand({kProgram, "export", out, "--frame", "utm"}, 300).exit_code, 0);
  const Trajectory utm = ReadTrajectory(out + "/frames.tum");
  EXPECT_NEAR(utm.front().world_from_camera.translation.x(), 333045, 100);
  EXPECT_NEAR(utm.front().world_from_camera.translation.y(), 3102800, 200);
  ASSERT_EQ(RunCommand({kProgram, "export", out, "--frame", "enu"}, 300).exit_code, 0);
  EXPECT_EQ(ReadText(out + "/frames.tum"), before);

  // What was left out is to be flown again.
  const Json gaps = Summary(out).at("gaps");
  EXPECT_EQ(gaps.at("unit"), "m");
  // Above the ground with its trees: a pixel is 0.138 m there along the axis, 66 m at f = 478 pixels, pitched by 75
  // degrees.
  EXPECT_NEAR(gaps.at("flight").at("height"), 64, 4);
  EXPECT_EQ(gaps.at("list").at(0).at("kind"), "stretch");
  EXPECT_EQ(gaps.at("list").at(0).at("first_frame"), 74);
  EXPECT_EQ(gaps.at("list").at(0).at("last_frame"), 83);
  EXPECT_GT(gaps.at("list").at(0).at("length"), 50);
  EXPECT_NE(ReadText(out + "/gaps.plan"), "");
}

TEST_F(World, PartsThatNothingJoinsLieWhereTheyBelong) {
  const std::string out = folder_ / "run";
  // The westernmost of the first flight and the easternmost of the second: their images have nothing in common.
  const CommandResult result = Run("0-31,44-144", out, {"--frame", "enu"});
  ASSERT_TRUE(result.exit_code == 0 || result.exit_code == 4) << result.output;
  const Json summary = Summary(out);
  ASSERT_EQ(summary.at("components").size(), 2u);
  for (const Json& component : summary.at("world").at("components")) ASSERT_TRUE(component.at("placed"));
  EXPECT_LE(LargestError(out + "/frames.tum"), 3);
  EXPECT_LE(LargestError(out + "/components/1/frames.tum"), 3);
  int num_connections = 0;
  for (const Json& gap : summary.at("gaps").at("list")) num_connections += gap.at("kind") == "connection";
  EXPECT_EQ(num_connections, 1);
}

TEST_F(World, WhatCannotBeReadIsToldBeforeAnythingIsStarted) {
  const CommandResult result = RunCommand(
      {kProgram, "run", kFlight + "video.mp4", "--gps", kFlight + "camera.yaml", "--out", folder_ / "run"}, 60);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.output.find("camera.yaml: no known format"), std::string::npos) << result.output;
}

}  // namespace world_test
}  // namespace mapmend
