// Kills that do not end: every other second one of a command's processes is killed, until the command has ended. It
// ends as if nobody had disturbed it, only later.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <random>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace kills_test {

using Clock = std::chrono::steady_clock;

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

// The frames around the break of the bundled flight: two submaps.
std::vector<std::string> RunArguments(const std::string& out) {
  return {kProgram, "run", kFlight + "video.mp4", "--skip-frames", "0-39,131-171", "--seed", "1", "--port", "0",
          "--out",  out};
}

class Kills : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    const auto begin = Clock::now();
    ASSERT_EQ(RunCommand(RunArguments(Undisturbed()), kPatienceS).exit_code, 0);
    const double took_s = std::chrono::duration<double>(Clock::now() - begin).count();
    // On an idle machine the flight takes twelve seconds. With a kill a second it ends as well, but takes minutes.
    pause_s_ = std::max(2.0, took_s / 6);
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static std::string Undisturbed() { return *folder_ / "undisturbed"; }

  // The number of kills that the command has survived. Fails the test if it does not end, or not with 0.
  static int KillUntilItEnds(const std::vector<std::string>& argv, unsigned seed) {
    const std::string output = *folder_ / "output";
    RunningCommand command(argv, output);
    std::mt19937 random(seed);
    int num_kills = 0;
    const auto begin = Clock::now();
    while (Clock::now() - begin < std::chrono::duration<double>(kPatienceS)) {
      if (const auto result = command.Wait(pause_s_)) {
        EXPECT_EQ(result->exit_code, 0) << result->output;
        EXPECT_EQ(command.SurvivorsAfter(10), std::vector<pid_t>());
        return num_kills;
      }
      const std::string programs[] = {"hub", "submap_store", "merger", "viewer_export"};
      if (const pid_t pid = FindProcess(command, programs[random() % std::size(programs)]); pid > 0) {
        kill(pid, SIGKILL);
        ++num_kills;
      }
    }
    ADD_FAILURE() << "has not ended after " << num_kills << " kills:\n" << ReadText(output);
    return num_kills;
  }
  static void ExpectTheSameMap(const std::string& out) {
    const std::string frames = ReadText(Undisturbed() + "/frames.tum");
    ASSERT_FALSE(frames.empty());
    EXPECT_EQ(ReadText(out + "/frames.tum"), frames);
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  static double pause_s_;
};

std::unique_ptr<TemporaryFolder> Kills::folder_;
double Kills::pause_s_ = 1;

TEST_F(Kills, AFlightIsMappedAllTheSame) {
  const std::string out = *folder_ / "flown";
  EXPECT_GE(KillUntilItEnds(RunArguments(out), 1), 3);
  ExpectTheSameMap(out);
}

TEST_F(Kills, AMapIsMergedAllTheSame) {
  const std::string out = *folder_ / "merged";
  std::filesystem::copy(Undisturbed(), out, std::filesystem::copy_options::recursive);
  std::filesystem::remove(out + "/frames.tum");
  EXPECT_GE(KillUntilItEnds({kProgram, "merge", out}, 2), 1);
  ExpectTheSameMap(out);
}

}  // namespace kills_test
}  // namespace mapmend
