// Processes that hang, or that keep dying: they are replaced, and the flight goes on.

#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace supervision_test {

namespace fs = std::filesystem;
const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";
const std::string kHub = "hub";

std::vector<std::string> RunArguments(const std::string& out, const std::vector<std::string>& more) {
  std::vector<std::string> argv = {kProgram, "run", kFlight + "video.mp4", "--port", "0", "--out", out};
  argv.insert(argv.end(), more.begin(), more.end());
  return argv;
}

class Hanging : public testing::TestWithParam<std::string> {};

TEST_P(Hanging, IsReplacedWithinTenSeconds) {
  const TemporaryFolder folder;
  const std::string program = GetParam();
  // In real time: it flies long enough.
  RunningCommand run(RunArguments(folder / "out", {"--realtime"}), folder / "output");
  ASSERT_TRUE(WaitUntil([&] { return FindProcess(run, "frontend") > 0; }, 60)) << ReadText(folder / "output");
  SleepSeconds(3);
  const pid_t pid = FindProcess(run, program);
  ASSERT_GT(pid, 0);
  kill(pid, SIGSTOP);
  const auto is_replaced = [&] {
    const pid_t next = FindProcess(run, program);
    return next > 0 && next != pid;
  };
  // Ten seconds, and as much again for a busy machine.
  EXPECT_TRUE(WaitUntil(is_replaced, 20)) << ReadText(folder / "output");
  EXPECT_NE(ReadText(folder / "output").find(" hangs (nothing has been heard of it for "), std::string::npos)
      << ReadText(folder / "output");
  run.Signal(SIGINT);
  const auto result = run.Wait(30);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->exit_code, 130) << result->output;
  EXPECT_EQ(run.SurvivorsAfter(10), std::vector<pid_t>());
}

INSTANTIATE_TEST_SUITE_P(EachProcess, Hanging,
                         testing::Values("submap_store", "merger", "viewer_export", "frontend", kHub),
                         [](const auto& parameter) { return "Process" + std::to_string(parameter.index); });

TEST(Supervision, AViewerThatKeepsDyingDoesNotEndTheFlight) {
  const TemporaryFolder folder;
  RunningCommand run(RunArguments(folder / "out", {"--skip-frames", "0-59"}), folder / "output");
  ASSERT_TRUE(WaitUntil([&] { return FindProcess(run, "frontend") > 0; }, 60)) << ReadText(folder / "output");
  // As fast as it comes back, until it is left alone for a while.
  for (int i = 0; i < 8 && !run.Wait(0); ++i) {
    pid_t pid = -1;
    if (!WaitUntil([&] { return (pid = FindProcess(run, "viewer_export")) > 0 || run.Wait(0); }, 12)) break;
    if (pid > 0) kill(pid, SIGKILL);
  }
  const auto result = run.Wait(300);
  ASSERT_TRUE(result) << ReadText(folder / "output");
  EXPECT_EQ(result->exit_code, 0) << result->output;
  EXPECT_NE(result->output.find("viewer_export ended with signal 9 (Killed); it is started again"), std::string::npos)
      << result->output;
  EXPECT_TRUE(fs::exists(folder / "out/report.html"));
}

TEST(Supervision, AMapThatIsRemovedUnderTheFlightIsWrittenAnew) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  RunningCommand run(RunArguments(out, {"--skip-frames", "0-59"}), folder / "output");
  const auto bytes = [&] { return ReadText(out + "/map.db-wal").size() + ReadText(out + "/map.db").size(); };
  ASSERT_TRUE(WaitUntil([&] { return bytes() > 600000; }, 60)) << ReadText(folder / "output");
  fs::remove(out + "/map.db");
  const auto result = run.Wait(300);
  ASSERT_TRUE(result) << ReadText(folder / "output");
  EXPECT_EQ(result->exit_code, 0) << result->output;
  EXPECT_NE(result->output.find("map.db: was removed while it was in use; what was in it has been written anew"),
            std::string::npos)
      << result->output;
  const auto check = RunCommand({kProgram, "db", "check", out + "/map.db"}, 60);
  EXPECT_EQ(check.exit_code, 0) << check.output;
  const nlohmann::json summary = nlohmann::json::parse(ReadText(out + "/summary.json"));
  EXPECT_GT(summary.at("frames_in_main").get<int>(), 60);
}

}  // namespace supervision_test
}  // namespace mapmend
