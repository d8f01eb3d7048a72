// A short recorded flight whose files are damaged afterwards: what is lost is named, the rest is mapped, what was there
// before stays until something complete takes its place.

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "libs/bus/recording_file.h"
#include "libs/wire/codec.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace damage_test {

namespace fs = std::filesystem;

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

CommandResult Call(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), kProgram);
  return RunCommand(arguments, kPatienceS);
}
std::string Hash(const std::string& db) { return Call({"db", "hash", db}).output; }
bool Contains(const CommandResult& result, const std::string& text) {
  return result.output.find(text) != std::string::npos;
}
nlohmann::json Summary(const std::string& out) { return nlohmann::json::parse(ReadText(out + "/summary.json")); }

void Write(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
}

class DamageTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    const CommandResult run = Call({"run", kFlight + "video.mp4", "--skip-frames", "0-55,74-83,106-171", "--seed", "3",
                                    "--port", "0", "--mosaic", "none", "--out", *folder_ / "flown", "--record",
                                    *folder_ / "log", "--groundtruth", kFlight + "groundtruth.tum"});
    ASSERT_TRUE(run.exit_code == 0 || run.exit_code == 4) << run.output;
  }
  static void TearDownTestSuite() { delete folder_; }

  std::string Copy(const std::string& name) const {
    fs::copy(*folder_ / "flown", *folder_ / name, fs::copy_options::recursive);
    return *folder_ / name;
  }
  // Where the n-th event on a channel lies in the recording.
  LoggedEvent Event(const std::string& channel, int n) const {
    RecordingFile log(*folder_ / "log/mapmend.lcmlog");
    LoggedEvent event;
    while (log.Next(&event)) {
      if (event.channel == channel && n-- == 0) break;
    }
    return event;
  }
  CommandResult Replay(const std::string& bytes, const std::string& name) const {
    Write(*folder_ / (name + ".lcmlog"), bytes);
    return Call({"replay", *folder_ / (name + ".lcmlog"), "--seed", "3", "--mosaic", "none", "--out", *folder_ / name});
  }

  static TemporaryFolder* folder_;
};
TemporaryFolder* DamageTest::folder_ = nullptr;

TEST_F(DamageTest, AFlippedBitInARecordingIsToldAndTheFlightGoesOnWithTheNextSubmap) {
  std::string bytes = ReadText(*folder_ / "log/mapmend.lcmlog");
  const LoggedEvent keyframe = Event("MAPMEND_KEYFRAME", 3);
  bytes[static_cast<size_t>(keyframe.offset) + 28 + 16 + keyframe.data.size() / 2] ^= 4;
  const CommandResult replay = Replay(bytes, "flipped");
  EXPECT_EQ(replay.exit_code, 3) << replay.output;
  const auto seq = PeekHeader(keyframe.data.data(), static_cast<int>(keyframe.data.size()))->seq;
  EXPECT_TRUE(Contains(replay, "record " + std::to_string(seq) + " (MAPMEND_KEYFRAME) at byte")) << replay.output;
  EXPECT_EQ(Summary(*folder_ / "flipped").at("submaps").size(), 2u);
  EXPECT_GT(Summary(*folder_ / "flipped").at("submaps")[1].at("frames"), 10);
}

TEST_F(DamageTest, LengthsAndEndsOfARecordingMayBeWrong) {
  const std::string bytes = ReadText(*folder_ / "log/mapmend.lcmlog");
  std::string endless = bytes;
  endless.replace(static_cast<size_t>(Event("MAPMEND_HEALTH", 2).offset) + 24, 4, "\x7f\xff\xff\xff");
  const CommandResult whole = Replay(endless, "endless");
  EXPECT_EQ(whole.exit_code, 3) << whole.output;
  EXPECT_TRUE(Contains(whole, "is damaged: ")) << whole.output;
  EXPECT_EQ(Hash(*folder_ / "endless/map.db"), Hash(*folder_ / "flown/map.db"));
  const CommandResult torn = Replay(bytes.substr(0, bytes.size() / 2), "torn");
  EXPECT_TRUE(torn.exit_code == 3 || torn.exit_code == 4) << torn.output;  // 4: less than half of it is in the map
  EXPECT_TRUE(Contains(torn, "breaks off after record")) << torn.output;
}

TEST_F(DamageTest, ADamagedMapIsMergedWithoutWhatIsDamagedAndRepairedFromItsRecording) {
  const std::string out = Copy("damaged"), db = out + "/map.db";
  const std::string before = Hash(db);
  SQLite::Database(db, SQLite::OPEN_READWRITE)
      .exec("UPDATE record SET payload = zeroblob(1000) WHERE seq = (SELECT max(seq) - 5 FROM record)");
  const std::string damaged = ReadText(db);
  const CommandResult check = Call({"db", "check", db});
  EXPECT_EQ(check.exit_code, 1);
  EXPECT_TRUE(Contains(check, "its checksum does not fit")) << check.output;
  const CommandResult hash = Call({"db", "hash", db});
  EXPECT_EQ(hash.exit_code, 1);
  EXPECT_TRUE(Contains(hash, "mapmend db repair")) << hash.output;

  const CommandResult merge = Call({"merge", out});
  EXPECT_EQ(merge.exit_code, 3) << merge.output;
  EXPECT_TRUE(Contains(merge, "not to be had (damaged)")) << merge.output;
  EXPECT_EQ(ReadText(db + ".damaged"), damaged);
  EXPECT_EQ(Call({"db", "check", db}).exit_code, 0);
  EXPECT_GT(Summary(out).at("frames_in_main"), 10);

  fs::rename(db + ".damaged", db);
  const CommandResult repair = Call({"db", "repair", out, "--from", *folder_ / "log/mapmend.lcmlog"});
  EXPECT_EQ(repair.exit_code, 0) << repair.output;
  EXPECT_TRUE(Contains(repair, "1 records from ")) << repair.output;
  EXPECT_EQ(Hash(db), before);
}

TEST_F(DamageTest, AZeroedPageDoesNotHoldUpAMerge) {
  const std::string db = *folder_ / "zeroed.db";
  fs::copy(*folder_ / "flown/map.db", db);
  std::string bytes = ReadText(db);
  bytes.replace(bytes.size() / 4096 / 2 * 4096, 4096, 4096, '\0');
  Write(db, bytes);
  const CommandResult merge = Call({"merge", db});
  EXPECT_EQ(merge.exit_code, 3) << merge.output;
  EXPECT_EQ(Call({"db", "check", db}).exit_code, 0);
}

TEST_F(DamageTest, AMergeThatIsKilledOrInterruptedLeavesTheOldMap) {
  const std::string out = Copy("killed"), db = out + "/map.db";
  const std::string before = Hash(db), report = ReadText(out + "/report.html");
  int num_struck = 0;
  bool was_faster = false;  // than the signal: then the map is the new one, and later moments say nothing
  for (const double seconds : {0.05, 0.2, 0.4, 0.7, 1.0, 2.0}) {
    for (const int signal : {SIGKILL, SIGINT}) {
      if (was_faster) break;
      SCOPED_TRACE(std::to_string(seconds) + " s, signal " + std::to_string(signal));
      // Another seed: another map.
      RunningCommand merge({kProgram, "merge", out, "--seed", "8"}, *folder_ / "killed_output");
      SleepSeconds(seconds);
      merge.Signal(signal);
      ASSERT_TRUE(merge.Wait(30));
      EXPECT_EQ(merge.SurvivorsAfter(10), std::vector<pid_t>());
      was_faster = ReadText(*folder_ / "killed_output").find("report.html") != std::string::npos;
      if (was_faster) break;
      ++num_struck;
      EXPECT_EQ(Hash(db), before);
      EXPECT_EQ(ReadText(out + "/report.html"), report);
    }
  }
  EXPECT_GE(num_struck, 4);
  const CommandResult merge = Call({"merge", out, "--seed", "8"});
  EXPECT_EQ(merge.exit_code, 0) << merge.output;
  EXPECT_NE(Hash(db), before);
  // Nothing unfinished is left, and the ground truth of the run is not forgotten.
  for (const auto& entry : fs::directory_iterator(out))
    EXPECT_EQ(entry.path().string().find(".merging"), std::string::npos) << entry.path();
  EXPECT_TRUE(Summary(out).contains("ate_rmse_m"));
}

TEST_F(DamageTest, WhatIsNoMapIsLeftAsItIs) {
  const std::string empty = *folder_ / "empty.db";
  Write(empty, "");
  for (const char* command : {"merge", "export"}) {
    const CommandResult result = Call({command, empty, "--out", *folder_ / "nothing"});
    EXPECT_EQ(result.exit_code, 1) << result.output;
    EXPECT_TRUE(Contains(result, "is empty")) << result.output;
    EXPECT_EQ(fs::file_size(empty), 0u);
  }
}

}  // namespace damage_test
}  // namespace mapmend
