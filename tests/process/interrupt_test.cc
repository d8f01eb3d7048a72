// Ctrl-C, or the sudden death of any process of a run: the database stays valid and nothing is left running.

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace interrupt_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

std::vector<std::string> RunArguments(const std::string& out) {
  return {kProgram, "run", kFlight + "video.mp4", "--out", out, "--port", "0", "--mosaic", "none"};
}

// Number of records in a database, -1 while there is none.
int CountRecords(const std::string& path) {
  try {
    SQLite::Database database(path, SQLite::OPEN_READONLY, 2000);
    return database.execAndGet("SELECT COUNT(*) FROM record").getInt();
  } catch (const SQLite::Exception&) {
    return -1;
  }
}

void ExpectValidDatabase(const std::string& path) {
  ASSERT_TRUE(std::filesystem::exists(path));
  SQLite::Database database(path, SQLite::OPEN_READWRITE, 5000);
  EXPECT_EQ(database.execAndGet("PRAGMA integrity_check").getString(), "ok");
}

class InterruptTest : public testing::TestWithParam<int> {};

TEST_P(InterruptTest, LeavesAValidDatabaseAndNoProcess) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  RunningCommand run(RunArguments(out), folder / "output");
  // Before the frontend has said anything (0), or after so many records.
  if (GetParam() == 0) {
    ASSERT_TRUE(WaitUntil([&] { return std::filesystem::exists(out + "/logs/hub.log"); }, 20));
  } else {
    ASSERT_TRUE(WaitUntil([&] { return CountRecords(out + "/map.db") >= GetParam(); }, 60))
        << ReadText(folder / "output");
  }
  run.Signal(SIGINT);
  const auto result = run.Wait(12);
  ASSERT_TRUE(result) << "still running after Ctrl-C";
  EXPECT_EQ(result->exit_code, 130) << result->output;
  EXPECT_EQ(run.Survivors(), std::vector<pid_t>());
  if (GetParam() > 0) {
    EXPECT_NE(result->output.find("interrupted: "), std::string::npos) << result->output;
    ExpectValidDatabase(out + "/map.db");
    EXPECT_GE(CountRecords(out + "/map.db"), GetParam());
  }
}

INSTANTIATE_TEST_SUITE_P(AtSeveralTimes, InterruptTest, testing::Values(0, 1, 20));

TEST(LauncherDeath, LeavesAValidDatabaseAndNoProcess) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  RunningCommand run(RunArguments(out), folder / "output");
  ASSERT_TRUE(WaitUntil([&] { return CountRecords(out + "/map.db") >= 10; }, 60)) << ReadText(folder / "output");
  run.Signal(SIGKILL);
  ASSERT_TRUE(run.Wait(5));
  EXPECT_EQ(run.SurvivorsAfter(10), std::vector<pid_t>());
  ExpectValidDatabase(out + "/map.db");
}

}  // namespace interrupt_test
}  // namespace mapmend
