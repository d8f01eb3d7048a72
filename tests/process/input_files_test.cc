// Inputs as people have them, through the whole of `mapmend run`: what can be used is mapped, what cannot is told.

#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <sstream>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace input_files_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";
constexpr int kFrames = 26;

class InputFilesTest : public testing::Test {
 protected:
  CommandResult Run(const std::vector<std::string>& arguments) {
    std::vector<std::string> argv = {kProgram,   "run",  "--camera", kFlight + "camera.yaml", "--port", "0",
                                     "--mosaic", "none", "--out",    folder_ / "out"};
    argv.insert(argv.end(), arguments.begin(), arguments.end());
    return RunCommand(argv, kPatienceS);
  }
  nlohmann::json Summary() { return nlohmann::json::parse(ReadText(folder_ / "out/summary.json")); }
  // The first frames of the flight as frame1.jpg, frame2.jpg, ...
  std::string Photos() {
    std::filesystem::create_directory(folder_ / "photos");
    cv::VideoCapture flight(kFlight + "video.mp4");
    cv::Mat image;
    for (int i = 1; i <= kFrames && flight.read(image); ++i) cv::imwrite(Photo(i), image);
    return folder_ / "photos";
  }
  std::string Photo(int number) { return folder_ / ("photos/frame" + std::to_string(number) + ".jpg"); }

  TemporaryFolder folder_;
};

TEST_F(InputFilesTest, AVideoWithoutACountOfFramesIsMapped) {
  const std::string video = folder_ / "2026-01-01T12:00:00.h264";
  const std::string command = "ffmpeg -v error -nostdin -i " + kFlight + "video.mp4 -frames:v " +
                              std::to_string(kFrames) + " -c copy -f h264 file:" + video;
  ASSERT_EQ(std::system(command.c_str()), 0);
  const CommandResult result = Run({video});
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(Summary()["frames_in"], kFrames);
  EXPECT_NE(result.output.find("has no times: "), std::string::npos) << result.output;
}

TEST_F(InputFilesTest, OddPhotosAreLeftOutAndTheOthersMappedInTheOrderOfTheirNumbers) {
  const std::string photos = Photos();
  cv::Mat half;
  cv::resize(cv::imread(Photo(6)), half, {}, 0.5, 0.5);
  cv::imwrite(Photo(6), half);
  std::filesystem::resize_file(Photo(11), std::filesystem::file_size(Photo(11)) / 2);
  std::ofstream(folder_ / "photos/._frame1.jpg") << "of another system";
  std::ofstream times(folder_ / "times.txt");
  for (int i = 0; i < kFrames; ++i) times << 1000 + i << "\r\n";
  times.close();
  const CommandResult result = Run({photos, "--times", folder_ / "times.txt"});
  EXPECT_EQ(result.exit_code, 3) << result.output;
  EXPECT_NE(result.output.find(photos + ": 2 frames were left out: " + Photo(6) +
                               " has 400 x 300 pixels, the flight 800 x 600, " + Photo(11) + " is cut short"),
            std::string::npos)
      << result.output;
  EXPECT_EQ(Summary()["frames_in"], kFrames - 2);
  EXPECT_EQ(Summary()["frontend"]["frames_left_out"], 2);
  // The last frame has the last time, whatever was left out before.
  std::istringstream poses(ReadText(folder_ / "out/frames.tum"));
  std::string last;
  for (std::string line; std::getline(poses, line);) last = line;
  EXPECT_EQ(last.rfind(std::to_string(999 + kFrames) + ".", 0), 0u) << last;
}

TEST_F(InputFilesTest, AFolderThatGrowsIsMappedAsItGrowsUntilCtrlC) {
  const std::string photos = Photos();
  std::vector<std::string> late;
  for (int i = kFrames / 2; i <= kFrames; ++i) {
    late.push_back(Photo(i));
    std::filesystem::rename(Photo(i), Photo(i) + ".part");
  }
  RunningCommand run({kProgram, "run", photos, "--follow", "--camera", kFlight + "camera.yaml", "--port", "0",
                      "--mosaic", "none", "--out", folder_ / "out"},
                     folder_ / "log");
  const auto has_read = [&](int count) {
    return WaitUntil(
        [&] { return ReadText(folder_ / "log").find(std::to_string(count) + " frames") != std::string::npos; }, 90);
  };
  EXPECT_TRUE(has_read(kFrames / 2 - 1)) << ReadText(folder_ / "log");
  for (const std::string& path : late) {
    std::filesystem::rename(path + ".part", path);
    SleepSeconds(0.05);
  }
  EXPECT_TRUE(has_read(kFrames)) << ReadText(folder_ / "log");
  run.Signal(SIGINT);
  const auto result = run.Wait(90);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->exit_code, 0) << result->output;
  EXPECT_EQ(Summary()["frames_in"], kFrames);
}

}  // namespace input_files_test
}  // namespace mapmend
