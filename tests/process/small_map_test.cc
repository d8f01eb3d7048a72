// A flight of which little or nothing can be mapped: the last line says so and why, and the exit code tells programs.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <regex>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace small_map_test {

using Json = nlohmann::json;

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

class SmallMapTest : public testing::Test {
 protected:
  // The bundled flight's first frames, changed one by one.
  std::string Video(int num_frames, const std::function<void(int, cv::Mat*)>& change) {
    cv::VideoCapture flight(kFlight + "video.mp4");
    const std::string path = folder_ / "video.avi";
    cv::VideoWriter writer(path, cv::CAP_OPENCV_MJPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 1,
                           cv::Size(800, 600));
    cv::Mat image;
    for (int i = 0; i < num_frames && flight.read(image); ++i) {
      change(i, &image);
      writer.write(image);
    }
    return path;
  }
  CommandResult Run(const std::string& input, const std::vector<std::string>& more = {}) {
    std::vector<std::string> argv = {kProgram, "run", input, "--out", Out(), "--port", "0", "--mosaic", "none"};
    argv.insert(argv.end(), more.begin(), more.end());
    if (std::find(more.begin(), more.end(), "--camera") == more.end())
      argv.insert(argv.end(), {"--camera", kFlight + "camera.yaml"});
    return RunCommand(argv, kPatienceS);
  }
  std::string Out() const { return folder_ / "out"; }
  // The exit code is 4, the last line names the reason, and every file that is named is there.
  void ExpectSmallMap(const CommandResult& result, const std::string& share, const std::string& reason) {
    EXPECT_EQ(result.exit_code, 4) << result.output;
    const size_t begin = result.output.rfind('\n', result.output.size() - 2) + 1;
    const std::string last = result.output.substr(begin);
    EXPECT_TRUE(last.starts_with("mapmend: " + share)) << last;
    EXPECT_NE(last.find(reason), std::string::npos) << last;
    EXPECT_NE(last.find("Try: "), std::string::npos) << last;
    const Json summary = Json::parse(ReadText(Out() + "/summary.json"));
    EXPECT_EQ("mapmend: " + summary.value("problem", "") + "\n", last);
    EXPECT_NE(ReadText(Out() + "/report.html").find(reason), std::string::npos);
    ASSERT_NE(result.output.find("  map          "), std::string::npos) << result.output;
    std::string files = result.output.substr(result.output.find("  map          ") + 15);
    files = files.substr(0, files.find('\n'));
    const std::regex word("[a-z]+\\.(db|ply|tum)");
    for (std::sregex_iterator it(files.begin(), files.end(), word), end; it != end; ++it) {
      EXPECT_TRUE(std::filesystem::exists(Out() + "/" + it->str())) << it->str();
    }
    EXPECT_EQ(files.find("map.ply") != std::string::npos, summary.at("frames_tracked") > 0) << files;
  }

  TemporaryFolder folder_;
};

TEST_F(SmallMapTest, Darkness) {
  const std::string video = Video(12, [](int, cv::Mat* image) { *image /= 32; });
  ExpectSmallMap(Run(video), "none of the 12 frames is in the map: ", "too dark");
  const Json summary = Json::parse(ReadText(Out() + "/summary.json"));
  EXPECT_EQ(summary.at("frontend").at("untracked"), Json({{"darkness", 12}}));
}

TEST_F(SmallMapTest, AnImageThatStandsStill) {
  cv::Mat still;
  const std::string video = Video(12, [&](int i, cv::Mat* image) {
    if (i == 0) still = image->clone();
    still.copyTo(*image);
  });
  ExpectSmallMap(Run(video), "none of the 12 frames is in the map: ", "hardly moves");
}

TEST_F(SmallMapTest, Blur) {
  const std::string video = Video(12, [](int, cv::Mat* image) { cv::GaussianBlur(*image, *image, {}, 12); });
  ExpectSmallMap(Run(video), "none of the 12 frames is in the map: ", "blurred");
}

TEST_F(SmallMapTest, TooFewFeatures) {
  const std::string video = Video(12, [](int, cv::Mat* image) { image->setTo(cv::Scalar(127, 127, 127)); });
  ExpectSmallMap(Run(video), "none of the 12 frames is in the map: ", "too few features");
}

TEST_F(SmallMapTest, NoOverlap) {
  ExpectSmallMap(Run(kFlight + "video.mp4", {"--skip-frames", "1-9,11-19,21-29,31-39,41-49,51-59,61-171"}),
                 "none of the 7 frames is in the map: ", "too little in common");
}

TEST_F(SmallMapTest, MostOfTheFlightIsMappedThenAllIsWell) {
  const CommandResult result = Run(kFlight + "video.mp4", {"--skip-frames", "20-171"});
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_FALSE(Json::parse(ReadText(Out() + "/summary.json")).contains("problem"));
}

TEST_F(SmallMapTest, EventsTellWhatHappenedToTracking) {
  // Frames 12 to 19 are black: tracking is lost there, and begins anew or is found again.
  const std::string video = Video(32, [](int i, cv::Mat* image) {
    if (i >= 12 && i < 20) image->setTo(cv::Scalar::all(0));
  });
  EXPECT_EQ(Run(video).exit_code, 0);
  std::ifstream file(Out() + "/events.jsonl");
  std::vector<std::string> names;
  for (std::string line; std::getline(file, line);) {
    const Json event = Json::parse(line);
    names.push_back(event.at("event"));
    if (names.back() != "lost") continue;
    EXPECT_EQ(event.at("frame"), 12);
    EXPECT_EQ(event.at("last_frame"), 11);
    EXPECT_EQ(event.at("reason"), "darkness");
    EXPECT_TRUE(event.contains("utime"));
  }
  ASSERT_GE(names.size(), 4u);
  EXPECT_EQ(names[0], "start");
  EXPECT_EQ(names[1], "submap");
  EXPECT_EQ(names[2], "lost");
  // What the merger joins in its last pass follows the end of tracking.
  EXPECT_EQ(std::count(names.begin(), names.end(), "end"), 1);
  for (auto it = std::find(names.begin(), names.end(), "end"); it != names.end(); ++it)
    EXPECT_TRUE(*it == "end" || *it == "joined" || *it == "separated") << *it;
  EXPECT_NE(ReadText(Out() + "/logs/frontend.log").find("tracking lost at frame 12 ("), std::string::npos);
}

}  // namespace small_map_test
}  // namespace mapmend
