#include "procs/frontend/waiting_images.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "procs/frontend/image_spooler.h"

namespace mapmend {
namespace waiting_images_test {

std::shared_ptr<Frame> FrameWithPixels(int index, int width = 640, int height = 480) {
  cv::Mat pixels(height, width, CV_8UC3);
  cv::RNG random(static_cast<uint64_t>(index) + 1);
  random.fill(pixels, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(pixels, pixels, {0, 0}, 5);
  auto frame = std::make_shared<Frame>();
  frame->index = index;
  frame->original.Set({nullptr, std::make_shared<const cv::Mat>(pixels), width, height});
  return frame;
}

TEST(WaitingImages, TakeAFractionOfTheMemoryAndAreKeptAsTheyWouldHaveBeen) {
  ImageOptions options;
  for (const int width : {kFullSize, 320}) {
    const auto frame = FrameWithPixels(3);
    const OriginalImage before = frame->original.Get();
    WaitingImages waiting(options, width, true);
    waiting.Add(frame);
    waiting.Flush();
    const OriginalImage after = frame->original.Get();
    EXPECT_EQ(after.pixels, nullptr);
    EXPECT_LT(SizeOf(after), SizeOf(before) / 10);
    EXPECT_EQ(EncodeImage(after, width, options.quality), EncodeImage(before, width, options.quality));
  }
}

TEST(WaitingImages, WhatCameAsJpegStaysAndWhatWasLetGoOfDoesNotComeBack) {
  WaitingImages waiting({}, kFullSize, true);
  const auto jpeg = FrameWithPixels(1), gone = FrameWithPixels(2);
  const OriginalImage original = {std::make_shared<const std::vector<uint8_t>>(100), nullptr, 640, 480};
  jpeg->original.Set(original);
  waiting.Add(jpeg);
  waiting.Add(gone);
  gone->original.LetGo();
  waiting.Flush();
  EXPECT_EQ(jpeg->original.Get().jpeg, original.jpeg);
  EXPECT_TRUE(gone->original.Get().IsNone());
}

TEST(WaitingImages, WhoMayNotWaitGivesTheOldestUpAndWhoMayLosesNone) {
  ImageOptions options;
  options.max_waiting_mb = 1;  // one image
  for (const bool may_wait : {false, true}) {
    std::vector<std::shared_ptr<Frame>> frames;
    for (int i = 0; i < 30; ++i) frames.push_back(FrameWithPixels(i));
    WaitingImages waiting(options, kFullSize, may_wait);
    for (const auto& frame : frames) waiting.Add(frame);
    waiting.Flush();
    int num_kept = 0;
    for (const auto& frame : frames) {
      EXPECT_EQ(frame->original.Get().pixels, nullptr);
      num_kept += frame->original.Get().IsNone() ? 0 : 1;
    }
    EXPECT_EQ(frames.back()->original.Get().IsNone(), false);
    EXPECT_EQ(num_kept == 30, may_wait) << num_kept;
  }
}

}  // namespace waiting_images_test
}  // namespace mapmend
