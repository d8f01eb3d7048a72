#include "libs/mosaic/blended_block.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mapmend {
namespace blended_block_test {

constexpr int kSize = 256, kLevels = 5;

cv::Mat Plain(int value) { return {kSize, kSize, CV_8UC3, cv::Scalar::all(value)}; }

// Columns from first on, up to last.
cv::Mat Columns(int first, int last) {
  cv::Mat mask = cv::Mat::zeros(kSize, kSize, CV_8U);
  mask.colRange(first, last).setTo(255);
  return mask;
}

const cv::Rect kAll(0, 0, kSize, kSize);

TEST(BlendedBlock, OneImageStaysAsItIs) {
  cv::Mat noise(kSize, kSize, CV_8UC3);
  cv::randu(noise, 20, 230);
  BlendedBlock block(noise.size(), kLevels);
  block.Add(noise, Columns(0, kSize), kAll);
  cv::Mat difference;
  cv::absdiff(block.Finish(), noise, difference);
  double most = 0;
  cv::minMaxLoc(difference.reshape(1), nullptr, &most);
  EXPECT_LE(most, 2);
}

TEST(BlendedBlock, BrightnessChangesSoftlyAcrossASeam) {
  BlendedBlock block({kSize, kSize}, kLevels);
  block.Add(Plain(80), Columns(0, 128), kAll);
  block.Add(Plain(160), Columns(128, kSize), kAll);
  const cv::Mat joined = block.Finish();
  const auto at = [&](int column) { return static_cast<int>(joined.at<cv::Vec3b>(128, column)[0]); };
  EXPECT_NEAR(at(4), 80, 4);
  EXPECT_NEAR(at(kSize - 4), 160, 4);
  EXPECT_NEAR(at(128), 120, 12);
  for (int column = 1; column < kSize; ++column) {
    EXPECT_LE(std::abs(at(column) - at(column - 1)), 5) << column << ": a step of 80 before";
    EXPECT_GE(at(column), at(column - 1) - 1) << column;
  }
}

TEST(BlendedBlock, EdgesStaySharp) {
  cv::Mat stripes(kSize, kSize, CV_8UC3, cv::Scalar::all(60));
  for (int row = 0; row < kSize; row += 8) stripes.rowRange(row, row + 4).setTo(cv::Scalar::all(180));
  BlendedBlock block(stripes.size(), kLevels);
  block.Add(stripes, Columns(0, 128), kAll);
  block.Add(stripes, Columns(128, kSize), kAll);
  cv::Mat difference;
  cv::absdiff(block.Finish(), stripes, difference);
  EXPECT_LT(cv::mean(difference)[0], 1) << "two images that agree";
}

TEST(BlendedBlock, WhatNoImageShowsTakesNoPart) {
  BlendedBlock block({kSize, kSize}, kLevels);
  block.Add(Plain(200), Columns(0, 100), kAll);
  const cv::Mat joined = block.Finish();
  for (const int column : {0, 50, 99}) EXPECT_NEAR(joined.at<cv::Vec3b>(128, column)[0], 200, 2) << column;
}

}  // namespace blended_block_test
}  // namespace mapmend
