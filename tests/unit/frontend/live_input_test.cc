// What anybody may send on a camera's channel: ends of the stream, images of other programs.

#include <gtest/gtest.h>

#include <bot_core/image_t.hpp>
#include <mapmend/image_t.hpp>
#include <opencv2/core.hpp>

#include "libs/image_messages/foreign_image.h"
#include "libs/image_messages/image_message.h"
#include "procs/frontend/ends_of_stream.h"

namespace mapmend {
namespace live_input_test {

using std::chrono::milliseconds;

class EndsOfStreamTest : public testing::Test {
 protected:
  void SayAt(int ms) { ends_.Said(start_ + milliseconds(ms)); }
  bool HasEndedAt(int ms) const { return ends_.HasEnded(start_ + milliseconds(ms)); }
  const EndsOfStream::Time start_ = std::chrono::steady_clock::now();
  EndsOfStream ends_;
};

TEST_F(EndsOfStreamTest, OneEndOrTwoProveNothing) {
  SayAt(0);
  SayAt(50);
  EXPECT_FALSE(HasEndedAt(60000));
  SayAt(5000);
  SayAt(9000);
  EXPECT_FALSE(HasEndedAt(60000));
}

TEST_F(EndsOfStreamTest, ThreeWithinASecondAndSilenceAfterwardsEndIt) {
  for (const int ms : {0, 50, 100}) SayAt(ms);
  EXPECT_FALSE(HasEndedAt(900));
  EXPECT_TRUE(HasEndedAt(1200));
}

TEST_F(EndsOfStreamTest, AGoodImageAfterwardsTakesItBack) {
  for (const int ms : {0, 50, 100}) SayAt(ms);
  ends_.GoodImage();
  EXPECT_FALSE(HasEndedAt(60000));
}

bot_core::image_t Foreign(const char* format, int bytes_per_pixel, int padding = 0) {
  bot_core::image_t message{};
  message.utime = 5;
  message.width = 4;
  message.height = 3;
  message.pixelformat = format[0] | format[1] << 8 | format[2] << 16 | format[3] << 24;
  message.row_stride = 4 * bytes_per_pixel + padding;
  message.size = message.row_stride * 3;
  message.data.assign(message.size, 0);
  for (int i = 0; i < message.size; ++i) message.data[i] = static_cast<uint8_t>(i);
  bot_core::image_metadata_t tag{};
  tag.key = "camera";
  tag.n = 2;
  tag.value = {1, 2};
  message.metadata = {tag};
  message.nmetadata = 1;
  return message;
}

bool Decode(const bot_core::image_t& message, image_t* image) {
  std::vector<uint8_t> bytes(static_cast<size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return DecodeForeignImage(bytes.data(), static_cast<int>(bytes.size()), image);
}

TEST(ForeignImage, TypeHashIsThatOfLibbot) {
  EXPECT_EQ(static_cast<uint64_t>(bot_core::image_metadata_t::_computeHash(nullptr)), 0x9a4b634d0577fb8eULL);
}

TEST(ForeignImage, RawFormatsAreTakenWithTheirStrides) {
  image_t image;
  ASSERT_TRUE(Decode(Foreign("GREY", 1, 4), &image));
  EXPECT_EQ(ImageProblem(image, 4, 3), "");
  EXPECT_EQ(image.format, image_t::GREY8);
  EXPECT_EQ(image.data[4], 8);  // the second row begins after the padding
  ASSERT_TRUE(Decode(Foreign("RGB3", 3), &image));
  EXPECT_EQ(ImageProblem(image, 4, 3), "");
  EXPECT_EQ(image.data[0], 2);
  EXPECT_EQ(image.data[2], 0);
  ASSERT_TRUE(Decode(Foreign("BGR3", 3, 5), &image));
  EXPECT_EQ(DecodeImage(image).pixels->at<cv::Vec3b>(1, 0)[0], 17);
  for (const char* format : {"RGB4", "BGR4"}) {
    ASSERT_TRUE(Decode(Foreign(format, 4), &image));
    EXPECT_EQ(ImageProblem(image, 4, 3), "") << format;
  }
  for (const char* format : {"YUYV", "UYVY"}) {
    ASSERT_TRUE(Decode(Foreign(format, 2), &image));
    EXPECT_EQ(ImageProblem(image, 4, 3), "") << format;
  }
}

TEST(ForeignImage, WhatDoesNotFitIsRefused) {
  image_t image;
  bot_core::image_t wrong = Foreign("RGB3", 3);
  wrong.height = 1000000;
  ASSERT_TRUE(Decode(wrong, &image));
  EXPECT_NE(ImageProblem(image, 4, 1000000), "");
  wrong = Foreign("RGB3", 3);
  wrong.row_stride = 1;
  ASSERT_TRUE(Decode(wrong, &image));
  EXPECT_NE(ImageProblem(image, 4, 3), "");
  wrong = Foreign("XYZ9", 3);
  ASSERT_TRUE(Decode(wrong, &image));
  EXPECT_NE(ImageProblem(image, 4, 3).find("is not known"), std::string::npos);
  const uint8_t garbage[] = {1, 2, 3};
  EXPECT_FALSE(DecodeForeignImage(garbage, 3, &image));
}

}  // namespace live_input_test
}  // namespace mapmend
