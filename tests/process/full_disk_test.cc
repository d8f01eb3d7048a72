// A disk that fills up under a flight. The disks are small file systems in memory, which only root can make.

#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace full_disk_test {

namespace fs = std::filesystem;
const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

// A file system of its own size in a folder, as long as it lives.
class SmallDisk {
 public:
  SmallDisk(const std::string& path, const std::string& size) : path_(path) {
    fs::create_directories(path);
    mounted_ = mount("tmpfs", path.c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
  }
  ~SmallDisk() {
    if (mounted_) umount2(path_.c_str(), MNT_DETACH);
  }
  bool IsMounted() const { return mounted_; }
  bool Resize(const std::string& size) {
    return mount("tmpfs", path_.c_str(), "tmpfs", MS_REMOUNT, ("size=" + size).c_str()) == 0;
  }

 private:
  std::string path_;
  bool mounted_ = false;
};

std::vector<std::string> RunArguments(const std::string& out, const std::vector<std::string>& more = {}) {
  std::vector<std::string> argv = {
      kProgram, "run", kFlight + "video.mp4", "--skip-frames", "0-39,131-171", "--port", "0", "--out", out};
  argv.insert(argv.end(), more.begin(), more.end());
  return argv;
}

TEST(FullDisk, TheFlightGoesOnAndIsWholeWhenThereIsRoomAgain) {
  const TemporaryFolder folder;
  SmallDisk disk(folder / "disk", "2m");
  if (!disk.IsMounted()) GTEST_SKIP() << "cannot mount a small disk here";
  RunningCommand run(RunArguments(folder / "disk/out"), folder / "output");
  ASSERT_TRUE(WaitUntil([&] { return ReadText(folder / "output").find("disk full: ") != std::string::npos; }, 120))
      << ReadText(folder / "output");
  SleepSeconds(2);
  ASSERT_TRUE(disk.Resize("200m"));
  const auto result = run.Wait(kPatienceS);
  ASSERT_TRUE(result) << ReadText(folder / "output");
  EXPECT_EQ(result->exit_code, 0) << result->output;
  const nlohmann::json summary = nlohmann::json::parse(ReadText(folder / "disk/out/summary.json"));
  EXPECT_GE(summary.at("frames_in_main").get<int>(), 87);
}

TEST(FullDisk, WithoutRoomTheFlightEndsWithOneLineAndIsRecoveredLater) {
  const TemporaryFolder folder;
  SmallDisk disk(folder / "disk", "2m");
  if (!disk.IsMounted()) GTEST_SKIP() << "cannot mount a small disk here";
  const std::string out = folder / "disk/out";
  RunningCommand run(RunArguments(out), folder / "output");
  const auto result = run.Wait(400);
  ASSERT_TRUE(result) << ReadText(folder / "output");
  EXPECT_EQ(result->signal, 0);
  EXPECT_EQ(result->exit_code, 1) << result->output;
  EXPECT_NE(result->output.find("disk full: "), std::string::npos) << result->output;
  EXPECT_EQ(run.Survivors(), std::vector<pid_t>());
  ASSERT_TRUE(disk.Resize("200m"));
  const auto recovered = RunCommand({kProgram, "recover", out}, kPatienceS);
  EXPECT_EQ(recovered.exit_code, 0) << recovered.output;
  EXPECT_TRUE(fs::exists(out + "/report.html"));
}

TEST(FullDisk, ARecordingThatBreaksOffIsToldAtOnceAndInTheExitCode) {
  const TemporaryFolder folder;
  SmallDisk disk(folder / "disk", "500k");
  if (!disk.IsMounted()) GTEST_SKIP() << "cannot mount a small disk here";
  const auto result = RunCommand(RunArguments(folder / "out", {"--record", folder / "disk"}), kPatienceS);
  EXPECT_EQ(result.exit_code, 1) << result.output;
  const std::string line = "the recording " + (folder / "disk") + "/mapmend.lcmlog is not whole";
  EXPECT_NE(result.output.find(line), std::string::npos) << result.output;
  EXPECT_TRUE(fs::exists(folder / "out/report.html"));
}

TEST(Recording, AKilledLoggerIsTold) {
  const TemporaryFolder folder;
  RunningCommand run(RunArguments(folder / "out", {"--record", folder / "recording"}), folder / "output");
  ASSERT_TRUE(WaitUntil([&] { return FindProcess(run, "frontend") > 0; }, 60)) << ReadText(folder / "output");
  const pid_t logger = FindProcess(run, "lcm-logger");
  ASSERT_GT(logger, 0);
  kill(logger, SIGKILL);
  const auto result = run.Wait(kPatienceS);
  ASSERT_TRUE(result) << ReadText(folder / "output");
  EXPECT_EQ(result->exit_code, 1) << result->output;
  EXPECT_NE(result->output.find("is not whole: lcm-logger ended with signal 9 (Killed)"), std::string::npos)
      << result->output;
}

}  // namespace full_disk_test
}  // namespace mapmend
