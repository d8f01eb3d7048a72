#include "libs/capture/decode_image.h"

#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "libs/capture/steady_range.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace decode_image_test {

cv::Mat Texture(int type = CV_8UC3) {
  cv::Mat pixels(120, 161, type);
  cv::RNG random(7);
  random.fill(pixels, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(pixels, pixels, {5, 5}, 2);
  return pixels;
}

std::vector<uint8_t> Encode(const std::string& ending, const cv::Mat& pixels, const std::vector<int>& options = {}) {
  std::vector<uint8_t> bytes;
  cv::imencode(ending, pixels, bytes, options);
  return bytes;
}

TEST(DecodeJpeg, PixelsAreThoseOfOpenCV) {
  for (const int type : {CV_8UC1, CV_8UC3}) {
    for (const int progressive : {0, 1}) {
      const auto bytes = Encode(".jpg", Texture(type), {cv::IMWRITE_JPEG_PROGRESSIVE, progressive});
      const DecodedImage image = DecodeJpeg(bytes.data(), bytes.size());
      ASSERT_TRUE(image.pixels) << image.problem;
      EXPECT_EQ(image.pixels->channels(), type == CV_8UC1 ? 1 : 3);
      EXPECT_EQ(cv::norm(*image.pixels, cv::imdecode(bytes, cv::IMREAD_ANYCOLOR), cv::NORM_INF), 0);
    }
  }
}

TEST(DecodeJpeg, EveryPartThatIsMissingIsSeen) {
  const auto bytes = Encode(".jpg", Texture());
  for (size_t size = 0; size < bytes.size() - 40; size += 97) {
    EXPECT_FALSE(DecodeJpeg(bytes.data(), size).pixels) << size << " of " << bytes.size();
  }
  EXPECT_EQ(DecodeJpeg(bytes.data(), bytes.size() / 2).problem, "is cut short");
}

TEST(DecodeJpeg, AMissingEndMarkAndBytesBehindItCostNothing) {
  auto bytes = Encode(".jpg", Texture());
  bytes.resize(bytes.size() - 2);
  EXPECT_TRUE(DecodeJpeg(bytes.data(), bytes.size()).pixels);
  bytes.insert(bytes.end(), {0xFF, 0xD9, 1, 2, 3, 0, 0});
  EXPECT_TRUE(DecodeJpeg(bytes.data(), bytes.size()).pixels);
}

TEST(ReadImageFile, DamagedFilesOfEveryFormatAreNoImages) {
  const ScratchFolder folder;
  for (const char* ending : {".jpg", ".png", ".bmp", ".tif", ".pgm", ".webp"}) {
    const auto bytes = Encode(ending, Texture(ending == std::string(".pgm") ? CV_8UC1 : CV_8UC3));
    const auto write = [&](size_t size) {
      const std::string path = folder.File(std::string("image") + ending);
      std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), static_cast<long>(size));
      return path;
    };
    EXPECT_TRUE(ReadImageFile(write(bytes.size())).pixels) << ending;
    const DecodedImage cut = ReadImageFile(write(bytes.size() / 2));
    EXPECT_FALSE(cut.pixels) << ending;
    EXPECT_NE(cut.problem, "") << ending;
    EXPECT_EQ(ReadImageFile(write(0)).problem, "is empty");
  }
  EXPECT_EQ(ReadImageFile("/no/such.jpg").problem, "cannot be read: No such file or directory");
}

// 1000 counts wide, as of a thermal camera.
cv::Mat Thermal(double offset = 0) {
  cv::Mat grey = Texture(CV_8UC1), pixels;
  cv::normalize(grey, grey, 0, 255, cv::NORM_MINMAX);
  grey.convertTo(pixels, CV_16U, 1000.0 / 255, 20000 + offset);
  return pixels;
}

double Spread(const cv::Mat& image) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(image, mean, deviation);
  return deviation[0];
}

TEST(SteadyRange, HotAndDeadPixelsDoNotMatter) {
  const double undisturbed = Spread(SteadyRange().To8Bit(Thermal()));
  EXPECT_GT(undisturbed, 30);
  for (const int value : {0, 1, 65534, 65535}) {
    cv::Mat pixels = Thermal();
    pixels.at<uint16_t>(60, 80) = static_cast<uint16_t>(value);
    EXPECT_NEAR(Spread(SteadyRange().To8Bit(pixels)), undisturbed, 1) << value;
  }
  cv::Mat framed = Thermal();
  framed.rowRange(0, 20).setTo(0);  // no data
  const cv::Mat scene = SteadyRange().To8Bit(framed).rowRange(20, 120);
  EXPECT_NEAR(Spread(scene), undisturbed, 5);
}

TEST(SteadyRange, SomethingHotThatComesIntoViewDoesNotDimTheRest) {
  SteadyRange range;
  const cv::Mat before = range.To8Bit(Thermal());
  cv::Mat pixels = Thermal();
  pixels(cv::Rect(10, 10, 60, 60)).setTo(30000);
  const cv::Mat after = range.To8Bit(pixels);
  const cv::Rect calm(90, 10, 60, 100);
  EXPECT_GT(Spread(after(calm)), 0.5 * Spread(before(calm)));
  EXPECT_LT(cv::norm(before(calm), after(calm), cv::NORM_L1) / calm.area(), 60);
}

TEST(SteadyRange, ANewSceneIsFollowedAtOnceAndTheSameImagesGiveTheSameBits) {
  SteadyRange a, b;
  for (const double offset : {0.0, 30.0, 9000.0, 8990.0, -15000.0}) {
    const cv::Mat x = a.To8Bit(Thermal(offset)), y = b.To8Bit(Thermal(offset));
    EXPECT_GT(Spread(x), 30) << offset;
    EXPECT_EQ(cv::norm(x, y, cv::NORM_INF), 0);
  }
  const cv::Mat eight = Texture();
  EXPECT_EQ(a.To8Bit(eight).data, eight.data);
}

}  // namespace decode_image_test
}  // namespace mapmend
