// The simulator as people call it: a short clip, its truth, and what happens to bad input and a full disk.

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "libs/base/write_file.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/trajectory_file.h"

namespace mapmend {
namespace simulate_test {

namespace fs = std::filesystem;

class SimulateTest : public ::testing::Test {
 protected:
  void SetUp() override {
    dir_ = fs::temp_directory_path() / ("mapmend_simulate_" + std::to_string(getpid()));
    fs::create_directories(dir_);
    std::ofstream(dir_ / "clip.yaml") << "base: uav_short\nframes: 30\ncamera: {width: 480, height: 270, fx: 305}\n"
                                         "scene: {x0: -50, y0: -50, width: 200, length: 160, texel: 0.25}\n"
                                         "events: [{kind: skip, at: 3, duration: 1}]\n";
  }
  void TearDown() override { fs::remove_all(dir_); }
  // Exit code; standard error into error_.
  int Run(const std::string& arguments, const std::string& before = "") {
    const std::string log = (dir_ / "stderr.txt").string();
    const std::string command =
        before + MAPMEND_BIN_DIR "/" + arguments + " >" + (dir_ / "stdout.txt").string() + " 2>" + log;
    const int status = std::system(command.c_str());
    error_ = ReadFile(log);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string Clip() const {
    return "simulate --quiet --scenario " + (dir_ / "clip.yaml").string() + " --out " + (dir_ / "out").string() + " ";
  }

  fs::path dir_;
  std::string error_;
};

TEST_F(SimulateTest, ShortClipIsWholeAndTrue) {
  ASSERT_EQ(Run(Clip()), 0) << error_;
  const fs::path out = dir_ / "out";
  for (const char* name :
       {"video.mp4", "times.txt", "camera.yaml", "groundtruth.tum", "gps.csv", "events.json", "terrain.ply"}) {
    EXPECT_TRUE(fs::exists(out / name)) << name;
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(out), fs::directory_iterator()), 7) << "nothing else is left behind";
  const Trajectory truth = ReadTrajectory((out / "groundtruth.tum").string());
  EXPECT_EQ(truth.size(), 25u) << "30 frames at 5 a second, one second of them left out";
  EXPECT_EQ(truth[14].utime + 1200000, truth[15].utime);
  const Camera camera = ReadCamera((out / "camera.yaml").string());
  EXPECT_EQ(camera.width, 480);
  EXPECT_EQ(camera.fx, 305);
  cv::VideoCapture video((out / "video.mp4").string());
  cv::Mat frame;
  size_t frames = 0;
  while (video.read(frame)) ++frames;
  EXPECT_EQ(frames, truth.size());
  const auto events = nlohmann::json::parse(ReadFile((out / "events.json").string()));
  ASSERT_EQ(events["events"].size(), 1u);
  EXPECT_EQ(events["events"][0]["first_written_frame"], 15);
  EXPECT_EQ(Run("mapmend eval " + (out / "groundtruth.tum").string() + " " + (out / "groundtruth.tum").string()), 0)
      << error_;
  EXPECT_NE(ReadFile((dir_ / "stdout.txt").string()).find("0.0000     0.0000     0.0000"), std::string::npos)
      << "the truth is where it says it is";

  // The same bits again, with other threads and through the launcher.
  const std::string first = ReadFile((out / "video.mp4").string());
  ASSERT_EQ(Run("mapmend " + Clip() + "--threads 3"), 0) << error_;
  EXPECT_EQ(ReadFile((out / "video.mp4").string()), first);
}

TEST_F(SimulateTest, BadInputEndsInOneLine) {
  EXPECT_NE(Run("simulate --scenario nowhere --out " + (dir_ / "out").string()), 0);
  EXPECT_NE(error_.find("nowhere is not known; known are"), std::string::npos) << error_;
  EXPECT_NE(Run(Clip() + "--frames 10-300"), 0);
  EXPECT_NE(error_.find("the scenario has frames 0-29"), std::string::npos) << error_;
  EXPECT_NE(Run(Clip() + "--size 640"), 0);
  EXPECT_NE(Run(Clip() + "--fps -3"), 0);
  std::ofstream(dir_ / "clip.yaml") << "base: uav_short\ntrajectory: {start: [0, 0, -4]}\n";
  EXPECT_NE(Run(Clip()), 0);
  EXPECT_NE(error_.find("trajectory.start"), std::string::npos) << error_;
  EXPECT_FALSE(fs::exists(dir_ / "out" / "video.mp4"));
}

// A limit on the size of files stands for a full disk.
TEST_F(SimulateTest, FullDiskLeavesNoVideoThatLooksWhole) {
  EXPECT_NE(Run(Clip(), "ulimit -f 20; trap '' XFSZ; "), 0);
  EXPECT_EQ(std::count(error_.begin(), error_.end(), '\n'), 1) << error_;
  EXPECT_FALSE(fs::exists(dir_ / "out" / "video.mp4"));
  EXPECT_FALSE(fs::exists(dir_ / "out" / "video.mp4.part"));
}

}  // namespace simulate_test
}  // namespace mapmend
