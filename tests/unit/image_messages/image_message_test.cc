#include "libs/image_messages/image_message.h"

#include <gtest/gtest.h>

#include <mapmend/image_t.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

namespace mapmend {
namespace image_message_test {

constexpr int kWidth = 64, kHeight = 48;

image_t Jpeg(int width = kWidth, int height = kHeight) {
  image_t message{};
  message.utime = 10;
  message.format = image_t::JPEG;
  message.width = width;
  message.height = height;
  cv::Mat pixels(height, width, CV_8UC3, cv::Scalar(200, 100, 50));
  cv::imencode(".jpg", pixels, message.data);
  message.num_bytes = static_cast<int32_t>(message.data.size());
  return message;
}

image_t Grey() {
  image_t message = Jpeg();
  message.format = image_t::GREY8;
  message.data.assign(kWidth * kHeight, 77);
  message.num_bytes = kWidth * kHeight;
  return message;
}

std::string Problem(const image_t& message) { return ImageProblem(message, kWidth, kHeight); }

TEST(ImageMessage, GoodImagesAreDecoded) {
  EXPECT_EQ(Problem(Jpeg()), "");
  const auto color = DecodeImage(Jpeg()).pixels;
  ASSERT_TRUE(color);
  EXPECT_EQ(color->channels(), 3);
  EXPECT_NEAR(color->at<cv::Vec3b>(5, 5)[0], 200, 8);
  EXPECT_EQ(Problem(Grey()), "");
  const auto grey = DecodeImage(Grey()).pixels;
  ASSERT_TRUE(grey);
  EXPECT_EQ(grey->size(), cv::Size(kWidth, kHeight));
  EXPECT_EQ(grey->at<uint8_t>(47, 63), 77);
}

TEST(ImageMessage, WhatIsWrongIsNamed) {
  image_t message = Grey();
  message.format = 7;
  EXPECT_NE(Problem(message).find("format 7"), std::string::npos);
  EXPECT_NE(Problem(Jpeg(32, 24)).find("image of 32 x 24 pixels, the camera file says 64 x 48"), std::string::npos);
  message = Grey();
  message.data.pop_back();
  --message.num_bytes;
  EXPECT_NE(Problem(message).find("3071 bytes"), std::string::npos);
  message = Jpeg();
  message.utime = -5;
  EXPECT_EQ(Problem(message), "time is negative");
}

TEST(ImageMessage, AJpegThatIsNoneOrOfAnotherSizeIsRefusedBeforeItIsDecoded) {
  image_t message = Jpeg(16, 16);
  message.width = kWidth;
  message.height = kHeight;
  EXPECT_NE(Problem(message).find("JPEG of 16 x 16 pixels"), std::string::npos);
  message.data = Jpeg().data;
  message.data[0] = 0;
  EXPECT_EQ(Problem(message), "the bytes are no JPEG");
  // Cut anywhere: refused or decoded to the right size, never a crash.
  const image_t whole = Jpeg();
  for (size_t size = 0; size < whole.data.size(); ++size) {
    image_t cut = whole;
    cut.data.resize(size);
    cut.num_bytes = static_cast<int32_t>(size);
    if (!Problem(cut).empty()) continue;
    const auto image = DecodeImage(cut).pixels;
    if (image) {
      EXPECT_EQ(image->size(), cv::Size(kWidth, kHeight));
    }
  }
}

TEST(ImageMessage, AnEmptyImageEndsTheStream) {
  EXPECT_TRUE(IsEndOfStream(image_t{}));
  EXPECT_FALSE(IsEndOfStream(Grey()));
}

}  // namespace image_message_test
}  // namespace mapmend
