#include "libs/map_view/keyframe_pixels.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace mapmend {
namespace keyframe_pixels_test {

// Smooth, so that it survives to be made smaller.
cv::Mat Texture(int type, int width, int height) {
  cv::Mat pixels(height, width, type);
  cv::RNG random(7);
  random.fill(pixels, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(pixels, pixels, {0, 0}, 12);
  return pixels;
}

KeyframeImage Encoded(const std::string& ending, const cv::Mat& pixels) {
  KeyframeImage image;
  image.width = pixels.cols;
  image.height = pixels.rows;
  cv::imencode(ending, pixels, image.bytes);
  return image;
}

TEST(DecodePixels, AreThoseOfOpenCVInThreeColours) {
  for (const int type : {CV_8UC1, CV_8UC3}) {
    for (const char* ending : {".jpg", ".png"}) {
      const KeyframeImage image = Encoded(ending, Texture(type, 161, 120));
      const cv::Mat pixels = DecodePixels(image);
      ASSERT_EQ(pixels.type(), CV_8UC3);
      EXPECT_EQ(cv::norm(pixels, cv::imdecode(image.bytes, cv::IMREAD_COLOR), cv::NORM_INF), 0) << ending << type;
    }
  }
}

TEST(DecodePixels, FewerAreAsManyAsAreWantedAtLeast) {
  const cv::Mat texture = Texture(CV_8UC3, 803, 601);
  const KeyframeImage image = Encoded(".jpg", texture);
  const std::vector<std::pair<int, int>> sides = {{0, 803},   {803, 803}, {402, 803}, {401, 402},
                                                  {200, 201}, {90, 101},  {1, 101}};
  for (const auto& [wanted, width] : sides) {
    const cv::Mat pixels = DecodePixels(image, wanted);
    EXPECT_EQ(pixels.cols, width) << "wanted " << wanted;
    cv::Mat small;
    cv::resize(texture, small, pixels.size(), 0, 0, cv::INTER_AREA);
    EXPECT_LT(cv::norm(small, pixels, cv::NORM_L1) / static_cast<double>(3 * pixels.total()), 1.5);
  }
}

TEST(DecodePixels, WhatIsNoImageIsEmpty) {
  KeyframeImage image = Encoded(".jpg", Texture(CV_8UC3, 64, 48));
  image.bytes.resize(20);
  EXPECT_TRUE(DecodePixels(image).empty());
  image.bytes.assign(100, 'x');
  EXPECT_TRUE(DecodePixels(image).empty());
  image.bytes.clear();
  EXPECT_TRUE(DecodePixels(image, 8).empty());
}

}  // namespace keyframe_pixels_test
}  // namespace mapmend
