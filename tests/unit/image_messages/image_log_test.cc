#include "libs/image_messages/image_log.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "libs/capture/image_source.h"
#include "tests/image_log_writer.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace image_log_test {

namespace fs = std::filesystem;

constexpr int kFrames = 6;
constexpr int64_t kStart = 1700000000000000, kStep = 40000;

int64_t Utime(int i) { return kStart + i * kStep; }

class ImageLogTest : public testing::Test {
 protected:
  ImageLogTest() {
    static const std::vector<cv::Mat> images =
        FirstImages(std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/video.mp4", kFrames);
    images_ = images;
  }
  std::string Path(const std::string& name) const { return folder_.File(name); }
  // Images [begin, end) with other messages between them.
  std::string Write(const std::string& name, int begin = 0, int end = kFrames) {
    ImageLogWriter log(Path(name));
    for (int i = begin; i < end; ++i) {
      log.Add("POSE", Utime(i), {1, 2, 3});
      log.AddImage("CAM", Utime(i), i + 1, images_[static_cast<size_t>(i)]);
    }
    return Path(name);
  }
  static ImageSource Open(const std::vector<std::string>& inputs, const std::string& channel = "CAM") {
    SourceOptions options;
    options.inputs = ExpandLogs(inputs);
    options.open_other = LogOpener(channel);
    return ImageSource(options);
  }
  static std::vector<SourceImage> ReadAll(ImageSource* source) {
    std::vector<SourceImage> all;
    while (auto image = source->Next()) all.push_back(*image);
    return all;
  }
  static std::string ErrorOf(const std::string& input, const std::string& channel) {
    try {
      Open({input}, channel);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "(no error)";
  }
  // Writes over the beginning of the message that holds image i.
  void Damage(const std::string& path, int i, size_t num_bytes) {
    std::ifstream in(path, std::ios::binary);
    std::string bytes((std::istreambuf_iterator<char>(in)), {});
    in.close();
    size_t at = 0;
    for (int k = 0; k <= i; ++k) at = bytes.find("CAM", at + 1);
    ASSERT_NE(at, std::string::npos);
    bytes.replace(at - 28, num_bytes, std::string(num_bytes, 'x'));
    std::ofstream(path, std::ios::binary) << bytes;
  }

  std::vector<cv::Mat> images_;
  ScratchFolder folder_;
};

TEST_F(ImageLogTest, ImagesOfTheChannelComeWithTheirOwnTimes) {
  ImageSource source = Open({Write("flight.lcmlog")});
  EXPECT_EQ(source.NumFrames(), kFrames);
  EXPECT_EQ(source.UsualSize(), std::pair(images_[0].cols, images_[0].rows));
  const auto read = ReadAll(&source);
  ASSERT_EQ(read.size(), static_cast<size_t>(kFrames));
  for (int i = 0; i < kFrames; ++i) {
    const SourceImage& image = read[static_cast<size_t>(i)];
    EXPECT_EQ(image.index, i);
    EXPECT_EQ(image.utime, Utime(i));
    EXPECT_LT(cv::norm(*image.pixels, images_[static_cast<size_t>(i)], cv::NORM_L1) /
                  static_cast<double>(image.pixels->total()),
              12);
  }
  EXPECT_EQ(source.Problem(), "");
}

TEST_F(ImageLogTest, ImagesOfBotCoreAreReadBitForBit) {
  {
    ImageLogWriter log(Path("libbot"));  // no ending: known by its first bytes
    for (int i = 0; i < kFrames; ++i) log.AddForeignImage("CAM", Utime(i), images_[static_cast<size_t>(i)]);
  }
  ImageSource source = Open({Path("libbot")});
  const auto read = ReadAll(&source);
  ASSERT_EQ(read.size(), static_cast<size_t>(kFrames));
  EXPECT_EQ(cv::norm(*read[3].pixels, images_[3], cv::NORM_INF), 0);
}

TEST_F(ImageLogTest, PartsAreOneFlightInTheOrderOfTheirTimes) {
  fs::create_directory(Path("parts"));
  // Names in another order than times.
  const std::string late = Write("parts/log.01", 3, 6), early = Write("parts/log.02", 0, 3);
  for (const auto& inputs : {std::vector<std::string>{Path("parts")}, {late, early}}) {
    ImageSource source = Open(inputs);
    const auto read = ReadAll(&source);
    ASSERT_EQ(read.size(), static_cast<size_t>(kFrames));
    for (int i = 0; i < kFrames; ++i) EXPECT_EQ(read[static_cast<size_t>(i)].utime, Utime(i));
    EXPECT_EQ(source.Problem(), "");
  }
}

TEST_F(ImageLogTest, WhatIsDamagedIsPassedOverAndTold) {
  const std::string path = Write("flight.lcmlog");
  Damage(path, 2, 40);
  ImageSource source = Open({path});
  const auto read = ReadAll(&source);
  ASSERT_EQ(read.size(), static_cast<size_t>(kFrames - 1));
  EXPECT_EQ(read[2].utime, Utime(3));
  EXPECT_NE(source.Problem().find("log " + path + " is damaged at 1 place ("), std::string::npos) << source.Problem();
}

TEST_F(ImageLogTest, ATornEndIsTold) {
  const std::string path = Write("flight.lcmlog");
  fs::resize_file(path, fs::file_size(path) - 1000);
  ImageSource source = Open({path});
  EXPECT_EQ(ReadAll(&source).size(), static_cast<size_t>(kFrames - 1));
  EXPECT_NE(source.Problem().find("breaks off in the middle of a message"), std::string::npos) << source.Problem();
}

TEST_F(ImageLogTest, MessagesThatAreNoGoodImagesAreCounted) {
  {
    ImageLogWriter log(Path("flight.lcmlog"));
    for (int i = 0; i < kFrames; ++i) {
      if (i == 1) log.Add("CAM", Utime(i), {1, 2, 3, 4, 5, 6, 7, 8, 9});
      if (i == 3) log.AddImage("CAM", Utime(i) - 5000000, 0, images_[0]);  // an older one, late
      cv::Mat image = images_[static_cast<size_t>(i)];
      if (i == 4) image = image(cv::Rect(0, 0, 64, 48)).clone();
      log.AddImage("CAM", Utime(i), i + 1, image);
    }
    for (int i = 0; i < 6; ++i) log.AddMessage("CAM", image_t{});  // the camera says that it ends
  }
  ImageSource source = Open({Path("flight.lcmlog")});
  EXPECT_EQ(ReadAll(&source).size(), static_cast<size_t>(kFrames - 1));
  const std::string problem = source.Problem();
  EXPECT_NE(problem.find("1 message on channel CAM is no image; 1 image with a time"), std::string::npos) << problem;
  EXPECT_NE(problem.find("1 frame was left out: flight.lcmlog, image 4 has 64 x 48 pixels"), std::string::npos)
      << problem;
}

TEST_F(ImageLogTest, ALogWithoutTheChannelNamesThoseItHolds) {
  const std::string path = Write("flight.lcmlog");
  EXPECT_EQ(ErrorOf(path, ""), "log " + path +
                                   " has no images on channel MAPMEND_IMAGE; it holds CAM (6 messages, images), POSE "
                                   "(6 messages): name the camera's with --image-channel");
  EXPECT_EQ(ErrorOf(path, "POSE"), "log " + path +
                                       ": none of the 6 messages on channel POSE is an image (image_t of mapmend or of "
                                       "bot_core)");
}

TEST_F(ImageLogTest, ARecordingOfTheStreamIsForReplay) {
  { ImageLogWriter(Path("stream.lcmlog")).Add("a/MAPMEND_SESSION", kStart, {1, 2, 3}); }
  EXPECT_NE(ErrorOf(Path("stream.lcmlog"), "").find("`mapmend replay " + Path("stream.lcmlog") + "`"),
            std::string::npos);
}

TEST_F(ImageLogTest, WhatIsNoLogIsRefused) {
  std::ofstream(Path("text.lcmlog")) << "not a log";
  EXPECT_EQ(ErrorOf(Path("text.lcmlog"), ""), "log " + Path("text.lcmlog") + " is not an LCM log");
  EXPECT_THROW(AreLogs({Write("flight.lcmlog"), Path("video.mp4")}), std::runtime_error);
  EXPECT_FALSE(AreLogs({Path("video.mp4")}));
  // Images in a folder are taken as such, whatever else lies there.
  cv::imwrite(Path("1.png"), images_[0]);
  EXPECT_EQ(ExpandLogs({folder_.Path()}), std::vector<std::string>{folder_.Path()});
}

}  // namespace image_log_test
}  // namespace mapmend
