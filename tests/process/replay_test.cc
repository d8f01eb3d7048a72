// One recorded flight, replayed at three speeds, with merger and store killed at two points of each: always the same
// map.

#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace replay_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

// The map grows with every keyframe.
double Size(const std::string& path) {
  std::error_code error;
  const auto bytes = std::filesystem::file_size(path, error);
  return error ? 0 : static_cast<double>(bytes);
}

std::string Hash(const std::string& db) { return RunCommand({kProgram, "db", "hash", db}).output; }

TEST(Replay, TheMapIsTheSameAtEverySpeedAndAfterRestartsOfMergerAndStore) {
  const TemporaryFolder folder;
  // The last strip of the first flight and the first strips of the second: two submaps that become one map.
  const CommandResult recorded =
      RunCommand({kProgram, "run", kFlight + "video.mp4", "--skip-frames", "0-55,74-83,106-171", "--seed", "1",
                  "--port", "0", "--mosaic", "none", "--out", folder / "flown", "--record", folder / "log"},
                 240);
  ASSERT_EQ(recorded.exit_code, 0) << recorded.output;
  const std::string flown = Hash(folder / "flown/map.db");
  ASSERT_NE(flown.find("map "), std::string::npos) << flown;
  ASSERT_EQ(flown.find("none"), std::string::npos) << flown;
  const double size = Size(folder / "flown/map.db");

  for (const std::string speed : {"0", "100", "40"}) {
    SCOPED_TRACE("speed " + speed);
    const std::string out = folder / ("replayed" + speed);
    RunningCommand run({kProgram, "replay", folder / "log/mapmend.lcmlog", "--seed", "1", "--speed", speed, "--mosaic",
                        "none", "--out", out},
                       folder / ("output" + speed));
    for (const double part : {0.25, 0.6}) {
      ASSERT_TRUE(WaitUntil([&] { return Size(out + "/map.db") + Size(out + "/map.db-wal") > part * size; }, 60))
          << ReadText(folder / ("output" + speed));
      KillAndAwaitReturn(run, "merger");
      KillAndAwaitReturn(run, "submap_store");
    }
    const auto result = run.Wait(kPatienceS);
    ASSERT_TRUE(result) << ReadText(folder / ("output" + speed));
    EXPECT_EQ(result->exit_code, 0) << result->output;
    EXPECT_EQ(Hash(out + "/map.db"), flown);
  }
}

}  // namespace replay_test
}  // namespace mapmend
