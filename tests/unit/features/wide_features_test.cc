#include "libs/features/wide_features.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace mapmend {
namespace wide_features_test {

// Random discs of many sizes.
cv::Mat MakeImage(int width, int height) {
  cv::Mat image(height, width, CV_8U, cv::Scalar(120));
  cv::RNG random(3);
  for (int i = 0; i < 900; ++i) {
    cv::circle(image, {random.uniform(0, width), random.uniform(0, height)}, random.uniform(2, 14),
               cv::Scalar(random.uniform(0, 255)), cv::FILLED, cv::LINE_AA);
  }
  return image;
}

TEST(WideFeatures, AreTheSameWhateverTheNumberOfThreads) {
  const cv::Mat image = MakeImage(640, 480);
  const int before = cv::getNumThreads();
  cv::setNumThreads(1);
  const WideFeatures one = ExtractWideFeatures(image, nullptr, {});
  cv::setNumThreads(4);
  const WideFeatures four = ExtractWideFeatures(image, nullptr, {});
  cv::setNumThreads(before);
  ASSERT_GT(one.Size(), 300);
  ASSERT_EQ(one.Size(), four.Size());
  EXPECT_EQ(one.descriptors, four.descriptors);
  for (int i = 0; i < one.Size(); ++i) EXPECT_EQ(one.keypoints[i].pixel, four.keypoints[i].pixel);
}

TEST(WideFeatures, AreRecognisedAtAnotherScaleAndTurn) {
  const cv::Mat image = MakeImage(640, 480);
  const cv::Matx23d warp = cv::getRotationMatrix2D({320, 240}, 25, 0.6);
  cv::Mat other;
  cv::warpAffine(image, other, warp, image.size());
  const WideFeatures a = ExtractWideFeatures(image, nullptr, {}), b = ExtractWideFeatures(other, nullptr, {});
  const std::vector<WideMatch> matches = MatchWide(a, b, {});
  ASSERT_GT(matches.size(), 60u);
  int num_right = 0;
  for (const WideMatch& m : matches) {
    const Eigen::Vector2f &p = a.keypoints[m.a].pixel, &q = b.keypoints[m.b].pixel;
    const double x = warp(0, 0) * p.x() + warp(0, 1) * p.y() + warp(0, 2);
    const double y = warp(1, 0) * p.x() + warp(1, 1) * p.y() + warp(1, 2);
    const double scale = b.keypoints[m.b].SizePx() / a.keypoints[m.a].SizePx();
    num_right += std::hypot(x - q.x(), y - q.y()) < 3 && std::abs(std::log2(scale / 0.6)) < 0.4;
  }
  EXPECT_GT(num_right, 0.9 * static_cast<double>(matches.size()));
}

TEST(WideFeatures, LargeImagesAreHalvedAndPlacesAreThoseOfTheWhole) {
  const cv::Mat image = MakeImage(640, 480);
  WideExtractionOptions small;
  small.max_megapixels = 0.1;
  const WideFeatures whole = ExtractWideFeatures(image, nullptr, {}),
                     halved = ExtractWideFeatures(image, nullptr, small);
  const std::vector<WideMatch> matches = MatchWide(whole, halved, {});
  ASSERT_GT(matches.size(), 50u);
  double sum_x = 0, sum_y = 0;
  int count = 0;
  for (const WideMatch& m : matches) {
    const Eigen::Vector2f d = whole.keypoints[m.a].pixel - halved.keypoints[m.b].pixel;
    if (d.norm() > 3) continue;
    sum_x += d.x();
    sum_y += d.y();
    ++count;
  }
  ASSERT_GT(count, 50);
  EXPECT_NEAR(sum_x / count, 0, 0.3);
  EXPECT_NEAR(sum_y / count, 0, 0.3);
}

TEST(WideFeatures, NoneIsWhereTheMaskIsZeroAndNotMoreThanWanted) {
  const cv::Mat image = MakeImage(640, 480);
  cv::Mat mask(image.size(), CV_8U, cv::Scalar(255));
  mask(cv::Rect(0, 0, 320, 480)) = 0;
  WideExtractionOptions few;
  few.max_features = 100;
  const WideFeatures features = ExtractWideFeatures(image, &mask, few);
  EXPECT_EQ(features.Size(), 100);
  for (const WideKeypoint& k : features.keypoints) EXPECT_GE(k.pixel.x(), 318);
}

TEST(WideFeatures, DistanceOfDescriptors) {
  WideDescriptor a{}, b{};
  for (size_t i = 0; i < a.size(); ++i) {
    a[i] = static_cast<uint8_t>(i % 128);
    b[i] = static_cast<uint8_t>(127 - i % 100);
  }
  int dot = 0, distance = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    dot += a[i] * b[i];
    distance += (a[i] - b[i]) * (a[i] - b[i]);
  }
  EXPECT_EQ(WideDot(a, b), dot);
  EXPECT_EQ(WideSquaredDistance(a, b), distance);
  a.fill(127);
  EXPECT_EQ(WideDot(a, a), 128 * 127 * 127) << "no pair of products overflows";
}

}  // namespace wide_features_test
}  // namespace mapmend
