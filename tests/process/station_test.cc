// A station on the ground and several vehicles: one map of what all have seen, whatever is killed meanwhile.

#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "procs/mapmend/out_folder.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace station_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";
// The bundled video holds two flights over one park.
const char* const kRedLeavesOut = "81-171";
const char* const kBlueLeavesOut = "0-80";

class StationTest : public testing::Test {
 protected:
  std::vector<std::string> StationArguments() const {
    return {kProgram, "station", "--out", ground_, "--port", std::to_string(port_.Port())};
  }
  std::vector<std::string> FlyArguments(const std::string& vehicle, const std::string& leave_out) const {
    return {kProgram,  "fly",   kFlight + "video.mp4", "--skip-frames", leave_out, "--vehicle", vehicle, "--station",
            Address(), "--out", folder_ / vehicle};
  }
  std::string Address() const { return "127.0.0.1:" + std::to_string(port_.Port()); }

  // Ctrl-C on the ground once both have delivered all; then the map must hold both in one piece.
  void ExpectOneMapOfBoth(RunningCommand* station) {
    station->Signal(SIGINT);
    const auto result = station->Wait(kPatienceS);
    ASSERT_TRUE(result) << ReadText(folder_ / "station");
    ASSERT_EQ(result->exit_code, 0) << result->output;
    EXPECT_EQ(station->Survivors(), std::vector<pid_t>());
    const nlohmann::json summary = nlohmann::json::parse(ReadText(ground_ + "/summary.json"));
    ASSERT_EQ(summary["sessions"].size(), 2U) << result->output;
    EXPECT_EQ(summary["components"].size(), 1U) << result->output;
    EXPECT_EQ(summary["frames_in"], 172);
    EXPECT_GE(summary["frames_in_main"].get<int>(), 165);
    const std::string report = ReadText(ground_ + "/report.html");
    for (const char* vehicle : {"red", "blue"}) {
      EXPECT_NE(report.find("\">" + std::string(vehicle) + "</td>"), std::string::npos) << vehicle;
    }
  }

  const TemporaryFolder folder_;
  const std::string ground_ = folder_ / "ground";
  const FreePort port_{27700, false, "--port"};
};

TEST_F(StationTest, TwoVehiclesAtTheSameTimeEndInOneMap) {
  RunningCommand station(StationArguments(), folder_ / "station");
  RunningCommand red(FlyArguments("red", kRedLeavesOut), folder_ / "red.txt");
  RunningCommand blue(FlyArguments("blue", kBlueLeavesOut), folder_ / "blue.txt");
  for (RunningCommand* vehicle : {&red, &blue}) {
    const auto result = vehicle->Wait(kPatienceS);
    ASSERT_TRUE(result) << ReadText(folder_ / "station");
    EXPECT_EQ(result->exit_code, 0) << result->output;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "red/outbox"));
  ExpectOneMapOfBoth(&station);
}

TEST_F(StationTest, AStationThatLosesPowerGoesOnWhereItWas) {
  auto station = std::make_unique<RunningCommand>(StationArguments(), folder_ / "station");
  RunningCommand red(FlyArguments("red", kRedLeavesOut), folder_ / "red.txt");
  RunningCommand blue(FlyArguments("blue", kBlueLeavesOut), folder_ / "blue.txt");
  ASSERT_TRUE(WaitUntil([&] { return ReadText(folder_ / "station").find("blue (") != std::string::npos; }, 120))
      << ReadText(folder_ / "station");
  SleepSeconds(2);
  station.reset();  // SIGKILL to all on the ground
  SleepSeconds(3);
  station = std::make_unique<RunningCommand>(StationArguments(), folder_ / "station");
  for (RunningCommand* vehicle : {&red, &blue}) {
    const auto result = vehicle->Wait(kPatienceS);
    ASSERT_TRUE(result) << ReadText(folder_ / "station");
    EXPECT_EQ(result->exit_code, 0) << result->output;
  }
  station->Signal(SIGINT);
  const auto result = station->Wait(kPatienceS);
  ASSERT_TRUE(result) << ReadText(folder_ / "station");
  ASSERT_EQ(result->exit_code, 0) << result->output;
  const nlohmann::json summary = nlohmann::json::parse(ReadText(ground_ + "/summary.json"));
  EXPECT_EQ(summary["components"].size(), 1U) << result->output;
  EXPECT_GE(summary["frames_in_main"].get<int>(), 165);
}

TEST_F(StationTest, AFlightWithoutAStationIsKeptAndDeliveredByTheNext) {
  RunningCommand red(FlyArguments("red", kRedLeavesOut), folder_ / "red.txt");
  ASSERT_TRUE(WaitUntil([&] { return ReadText(folder_ / "red.txt").find("  81 tracked") != std::string::npos; }, 120))
      << ReadText(folder_ / "red.txt");
  red.Signal(SIGINT);  // the pilot gives up waiting
  const auto left = red.Wait(60);
  ASSERT_TRUE(left);
  EXPECT_NE(left->exit_code, 0);
  EXPECT_GT(std::filesystem::file_size(folder_ / "red/outbox"), 100000U);

  RunningCommand station(StationArguments(), folder_ / "station");
  auto second = FlyArguments("blue", kBlueLeavesOut);
  second.back() = folder_ / "red";  // the same folder on board
  const CommandResult result = RunCommand(second, kPatienceS);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "red/outbox"));
  ExpectOneMapOfBoth(&station);
}

}  // namespace station_test
}  // namespace mapmend
