#include "procs/frontend/image_spooler.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/scratch_folder.h"

namespace mapmend {
namespace image_spooler_test {

cv::Mat Pattern(int width, int height) {
  cv::Mat image(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      image.at<cv::Vec3b>(y, x) = {static_cast<uint8_t>(x), static_cast<uint8_t>(y), static_cast<uint8_t>(x + y)};
  }
  return image;
}

OriginalImage AsPixels(const cv::Mat& pixels) {
  return {nullptr, std::make_shared<const cv::Mat>(pixels), pixels.cols, pixels.rows};
}

OriginalImage AsJpeg(const cv::Mat& pixels) {
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", pixels, bytes, {cv::IMWRITE_JPEG_QUALITY, 70});
  return {std::make_shared<const std::vector<uint8_t>>(std::move(bytes)), nullptr, pixels.cols, pixels.rows};
}

TEST(EncodeImage, AJpegIsPassedOnByteForByte) {
  const OriginalImage original = AsJpeg(Pattern(320, 200));
  const KeyframeImage image = EncodeImage(original, kFullSize, 90);
  EXPECT_EQ(image.bytes, *original.jpeg);
  EXPECT_EQ(image.encoding, "jpeg");
  EXPECT_EQ(image.width, 320);
  EXPECT_EQ(image.height, 200);
  EXPECT_EQ(EncodeImage(original, 320, 90).bytes, *original.jpeg);
  const KeyframeImage smaller = EncodeImage(original, 160, 90);
  EXPECT_EQ(smaller.width, 160);
  EXPECT_EQ(smaller.height, 100);
  EXPECT_EQ(cv::imdecode(smaller.bytes, cv::IMREAD_COLOR).size(), cv::Size(160, 100));
}

TEST(EncodeImage, PixelsAreEncoded) {
  const cv::Mat pixels = Pattern(300, 200);
  const KeyframeImage png = EncodeImage(AsPixels(pixels), kFullSize, 0);
  EXPECT_EQ(png.encoding, "png");
  EXPECT_EQ(cv::norm(cv::imdecode(png.bytes, cv::IMREAD_COLOR), pixels, cv::NORM_INF), 0) << "without loss";
  const KeyframeImage good = EncodeImage(AsPixels(pixels), kFullSize, 95),
                      poor = EncodeImage(AsPixels(pixels), kFullSize, 10);
  EXPECT_LT(poor.bytes.size(), good.bytes.size());
  cv::Mat grey;
  cv::cvtColor(pixels, grey, cv::COLOR_BGR2GRAY);
  EXPECT_EQ(cv::imdecode(EncodeImage(AsPixels(grey), kFullSize, 90).bytes, cv::IMREAD_UNCHANGED).channels(), 1);
  EXPECT_THROW(EncodeImage({}, kFullSize, 90), std::runtime_error);
}

TEST(ImageSpooler, SpoolsWhatItIsGivenUnderItsKeyframe) {
  const ScratchFolder folder;
  ImageFile file(folder.File("spool"), ImageFile::Mode::kReadWrite);
  {
    ImageSpooler spooler(&file, ImageOptions(), kFullSize);
    spooler.Expect("s", KeyframeId(9));
    EXPECT_TRUE(spooler.IsPending("s", KeyframeId(9)));
    for (int i = 0; i < 5; ++i) spooler.Push({"s", KeyframeId(i), 10 + i, 1000 + i, AsPixels(Pattern(64, 48 + i))});
    spooler.ExpectNoMore();
    EXPECT_FALSE(spooler.IsPending("s", KeyframeId(9)));
    spooler.Flush();
    EXPECT_FALSE(spooler.IsPending("s", KeyframeId(0)));
    ASSERT_TRUE(file.Get("s", KeyframeId(3)));
    spooler.Push({"s", KeyframeId(5), 15, 1005, AsPixels(Pattern(64, 53))});
  }
  // Nothing that was pushed is lost when it ends.
  const auto image = file.Get("s", KeyframeId(5));
  ASSERT_TRUE(image);
  EXPECT_EQ(image->frame, 15);
  EXPECT_EQ(image->utime, 1005);
  EXPECT_EQ(image->height, 53);
}

TEST(ImageSpooler, LeavesTheDiskToTheStream) {
  const ScratchFolder folder;
  ImageFile file(folder.File("spool"), ImageFile::Mode::kReadWrite);
  ImageOptions options;
  options.min_free_mb = 100000000;
  ImageSpooler spooler(&file, options, kFullSize);
  spooler.Push({"s", KeyframeId(1), 1, 1, AsPixels(Pattern(64, 48))});
  spooler.Flush();
  EXPECT_TRUE(file.List().empty());
  EXPECT_EQ(spooler.NumGivenUp(), 1);
}

TEST(ImageOptions, SaysWhatIsKnown) {
  ImageOptions options;
  EXPECT_EQ(KeptWidth(options, false), kFullSize);
  EXPECT_EQ(KeptWidth(options, true), 640);
  options.keep = "none";
  EXPECT_EQ(KeptWidth(options, true), kNoImages);
  options.keep = "1280";
  EXPECT_EQ(KeptWidth(options, true), 1280);
  for (const char* wrong : {"fulll", "0", "-5", "640px", "99999999999"}) {
    options.keep = wrong;
    EXPECT_NE(options.Conflict().find("known are full, none, and a width"), std::string::npos) << wrong;
  }
}

}  // namespace image_spooler_test
}  // namespace mapmend
