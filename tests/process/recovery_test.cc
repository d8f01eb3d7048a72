// SIGKILL for every process of a run in turn: the launcher brings it back and the map is the one of an undisturbed run.
// A killed frontend goes on in a new submap of the same session.

#include <gtest/gtest.h>

#include <csignal>
#include <nlohmann/json.hpp>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace recovery_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

// The second half of the first flight and all of the second: two submaps, and long enough to kill each process while
// frames still come.
constexpr int kNumFrames = 132;
std::vector<std::string> RunArguments(const std::string& out) {
  return {kProgram,
          "run",
          kFlight + "video.mp4",
          "--skip-frames",
          "0-39",
          "--session",
          "7a0f3c52-61d4-4d0b-8f0e-0c9be5a4e101",
          "--seed",
          "1",
          "--port",
          "0",
          "--mosaic",
          "none",
          "--out",
          out};
}

nlohmann::json Summary(const std::string& out) {
  const std::string text = ReadText(out + "/summary.json");
  return text.empty() ? nlohmann::json::object() : nlohmann::json::parse(text);
}

TEST(Recovery, KilledProcessesComeBackAndTheMapIsTheSame) {
  const TemporaryFolder folder;
  ASSERT_EQ(RunCommand(RunArguments(folder / "undisturbed"), kPatienceS).exit_code, 0);

  RunningCommand run(RunArguments(folder / "disturbed"), folder / "output");
  ASSERT_TRUE(WaitUntil([&] { return FindProcess(run, "frontend") > 0; }, 60)) << ReadText(folder / "output");
  for (const std::string& program :
       {std::string("submap_store"), std::string("merger"), std::string("viewer_export"), std::string("hub")}) {
    SleepSeconds(0.2);
    KillAndAwaitReturn(run, program);
  }
  const auto result = run.Wait(kPatienceS);
  ASSERT_TRUE(result) << ReadText(folder / "output");
  EXPECT_EQ(result->exit_code, 0) << result->output;
  EXPECT_EQ(run.Survivors(), std::vector<pid_t>());

  const nlohmann::json first = Summary(folder / "undisturbed"), second = Summary(folder / "disturbed");
  for (const char* key : {"submaps", "components", "connections", "frames_tracked", "points_in_main"}) {
    EXPECT_EQ(first.at(key), second.at(key)) << key;
  }
  EXPECT_EQ(ReadText(folder / "undisturbed/frames.tum"), ReadText(folder / "disturbed/frames.tum"));
}

TEST(Recovery, AKilledFrontendGoesOnWithTheFlight) {
  const TemporaryFolder folder;
  RunningCommand run(RunArguments(folder / "out"), folder / "output");
  // After some keyframes are in the store: each takes some twenty thousand bytes.
  ASSERT_TRUE(WaitUntil(
      [&] { return ReadText(folder / "out/map.db-wal").size() + ReadText(folder / "out/map.db").size() > 1000000; },
      60))
      << ReadText(folder / "output");
  KillAndAwaitReturn(run, "frontend");
  const auto result = run.Wait(kPatienceS);
  ASSERT_TRUE(result) << ReadText(folder / "output");
  EXPECT_EQ(result->exit_code, 0) << result->output;
  EXPECT_NE(result->output.find("frontend ended with signal 9 (Killed); it is started again"), std::string::npos)
      << result->output;
  EXPECT_EQ(run.Survivors(), std::vector<pid_t>());
  const nlohmann::json summary = Summary(folder / "out");
  ASSERT_TRUE(summary.contains("frames_in_main")) << result->output;
  EXPECT_TRUE(summary.at("final").get<bool>());
  EXPECT_EQ(summary.at("frames_in").get<int>(), kNumFrames);
  EXPECT_GE(summary.at("frames_in_main").get<int>(), kNumFrames - 4);
}

}  // namespace recovery_test
}  // namespace mapmend
