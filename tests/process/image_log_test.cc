// A flight out of a log of lcm-logger through the whole of `mapmend run`, as from a file: every frame, the same each
// time.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/image_log_writer.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace image_log_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";
constexpr int kFrames = 24;
constexpr int64_t kStart = 1700000000000000, kStep = 100000;

class ImageLogTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto images = FirstImages(kFlight + "video.mp4", kFrames);
    ASSERT_EQ(images.size(), static_cast<size_t>(kFrames));
    std::filesystem::create_directory(folder_ / "parts");
    ImageLogWriter whole(folder_ / "flight.lcmlog"), first(folder_ / "parts/log.00"), second(folder_ / "parts/log.01");
    for (int i = 0; i < kFrames; ++i) {
      const cv::Mat& image = images[static_cast<size_t>(i)];
      whole.AddImage("CAMERA", kStart + i * kStep, i + 1, image);
      (i < kFrames / 2 ? first : second).AddImage("CAMERA", kStart + i * kStep, i + 1, image);
    }
  }
  CommandResult Run(const std::string& input, const std::string& out, const std::string& channel = "CAMERA") {
    return RunCommand({kProgram, "run", input, "--camera", kFlight + "camera.yaml", "--image-channel", channel,
                       "--port", "0", "--mosaic", "none", "--out", folder_ / out},
                      180);
  }
  nlohmann::json Summary(const std::string& out) {
    return nlohmann::json::parse(ReadText(folder_ / (out + "/summary.json")));
  }

  TemporaryFolder folder_;
};

TEST_F(ImageLogTest, EveryImageIsMappedWithItsTimeAndPartsGiveTheSameMap) {
  const CommandResult whole = Run(folder_ / "flight.lcmlog", "whole");
  EXPECT_EQ(whole.exit_code, 0) << whole.output;
  EXPECT_EQ(Summary("whole")["frames_in"], kFrames);
  EXPECT_EQ(Summary("whole")["frontend"]["mode"], "lockstep");
  const std::string poses = ReadText(folder_ / "whole/frames.tum");
  EXPECT_NE(poses.find("1700000002.300000"), std::string::npos) << poses;  // the last image's
  const CommandResult parts = Run(folder_ / "parts", "parts-out");
  EXPECT_EQ(parts.exit_code, 0) << parts.output;
  EXPECT_EQ(ReadText(folder_ / "parts-out/frames.tum"), poses);
}

TEST_F(ImageLogTest, ADamagedLogIsMappedAndTheDamageTold) {
  std::fstream file(folder_ / "flight.lcmlog", std::ios::binary | std::ios::in | std::ios::out);
  file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(folder_ / "flight.lcmlog") / 2));
  const std::string noise(200000, 'x');
  file.write(noise.data(), static_cast<std::streamsize>(noise.size()));
  file.close();
  const CommandResult result = Run(folder_ / "flight.lcmlog", "out");
  EXPECT_EQ(result.exit_code, 3) << result.output;
  EXPECT_NE(result.output.find("is damaged at 1 place ("), std::string::npos) << result.output;
  EXPECT_LT(Summary("out")["frames_in"], kFrames);
}

TEST_F(ImageLogTest, AWrongChannelIsRefusedBeforeAnythingIsWritten) {
  const CommandResult result = Run(folder_ / "flight.lcmlog", "out", "CAM");
  EXPECT_EQ(result.exit_code, 1) << result.output;
  EXPECT_NE(result.output.find("has no images on channel CAM; it holds CAMERA (24 messages, images)"),
            std::string::npos)
      << result.output;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

}  // namespace image_log_test
}  // namespace mapmend
