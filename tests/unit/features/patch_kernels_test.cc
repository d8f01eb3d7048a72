#include "libs/features/patch_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace mapmend {
namespace patch_kernels_test {

constexpr int kWidth = 150, kHeight = 90;

// Smoothed noise with flat parts, saturated parts and room to read ahead.
cv::Mat TestImage() {
  cv::Mat image(kHeight, kWidth + PatchKernels::kReadAhead, CV_8UC1);
  cv::RNG rng(3);
  rng.fill(image, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(image, image, cv::Size(0, 0), 1.2);
  cv::normalize(image, image, -60, 320, cv::NORM_MINMAX);
  image(cv::Rect(40, 30, 20, 20)) = 128;
  return image;
}

class Kernels : public testing::TestWithParam<const PatchKernels*> {
 protected:
  const cv::Mat image_ = TestImage();
  const ptrdiff_t stride_ = static_cast<ptrdiff_t>(image_.step);
};

TEST_P(Kernels, FastScoresAgreeWithOpenCv) {
  for (const int threshold : {7, 20, 60}) {
    cv::Mat scores(kHeight, kWidth + 2 * PatchKernels::kReadAhead, CV_8UC1, cv::Scalar(99));
    for (int y = 3; y < kHeight - 3; ++y) {
      const bool any =
          GetParam()->fast_row(image_.ptr(y), stride_, 3, kWidth - 3, static_cast<uint8_t>(threshold), scores.ptr(y));
      EXPECT_GE(any, cv::countNonZero(scores(cv::Rect(3, y, kWidth - 6, 1))) > 0);
      EXPECT_EQ(scores.at<uint8_t>(y, kWidth - 3), 0);
    }
    std::vector<cv::KeyPoint> keypoints;
    cv::FAST(image_(cv::Rect(0, 0, kWidth, kHeight)), keypoints, threshold, false);
    ASSERT_GT(keypoints.size(), 100u);
    int num_positive = cv::countNonZero(scores(cv::Rect(3, 3, kWidth - 6, kHeight - 6)));
    EXPECT_EQ(num_positive, static_cast<int>(keypoints.size()));
    for (const cv::KeyPoint& k : keypoints) EXPECT_GT(scores.at<uint8_t>(k.pt), threshold);

    // OpenCV's response is the largest threshold that still passes: one less, as it asks for more than the threshold.
    std::vector<cv::KeyPoint> maxima;
    cv::FAST(image_(cv::Rect(0, 0, kWidth, kHeight)), maxima, threshold, true);
    for (const cv::KeyPoint& k : maxima) EXPECT_EQ(scores.at<uint8_t>(k.pt), static_cast<int>(k.response) + 1);
  }
}

TEST_P(Kernels, MaximaAreStrictTowardsWhatCameBefore) {
  const int width = 70;
  cv::Mat scores(3, width + 2 * PatchKernels::kReadAhead, CV_8UC1, cv::Scalar(0));
  scores.at<uint8_t>(1, 10) = 50;                                  // alone
  scores.at<uint8_t>(1, 20) = scores.at<uint8_t>(1, 21) = 50;      // equal: the first
  scores.at<uint8_t>(1, 30) = 50, scores.at<uint8_t>(0, 31) = 50;  // equal above: not
  scores.at<uint8_t>(1, 40) = 50, scores.at<uint8_t>(2, 39) = 50;  // equal below: yes
  scores.at<uint8_t>(1, 50) = 50, scores.at<uint8_t>(2, 50) = 51;
  scores.at<uint8_t>(1, 69) = 9;
  std::vector<int16_t> found(width);
  found.resize(GetParam()->maxima_row(scores.ptr(0), scores.ptr(1), scores.ptr(2), 5, width, found.data()));
  EXPECT_EQ(found, (std::vector<int16_t>{10, 20, 40, 69}));
}

TEST_P(Kernels, BlurIsAGaussian) {
  cv::Mat expected;
  cv::GaussianBlur(image_, expected, cv::Size(7, 7), 2, 2, cv::BORDER_REFLECT_101);
  std::vector<uint8_t> patch(39 * PatchKernels::kBlurStride);
  const int cx = 60, cy = 45;
  GetParam()->blur_patch(image_.ptr(cy) + cx, stride_, patch.data());
  int max_difference = 0;
  for (int y = -19; y <= 19; ++y) {
    for (int x = -19; x <= 19; ++x) {
      const int value = patch[(y + 19) * PatchKernels::kBlurStride + x + 19];
      max_difference = std::max(max_difference, std::abs(value - expected.at<uint8_t>(cy + y, cx + x)));
    }
  }
  EXPECT_LE(max_difference, 1);
}

TEST_P(Kernels, MomentsAndTensorAgreeWithTheirDefinition) {
  const auto at = [&](int x, int y) { return static_cast<int>(image_.at<uint8_t>(y, x)); };
  for (const auto& [cx, cy] : {std::pair(30, 40), std::pair(120, 25), std::pair(50, 40), std::pair(77, 60)}) {
    int m10 = 0, m01 = 0;
    for (int y = -15; y <= 15; ++y) {
      for (int x = -15; x <= 15; ++x) {
        if (x * x + y * y > 15 * 15) continue;
        m10 += x * at(cx + x, cy + y);
        m01 += y * at(cx + x, cy + y);
      }
    }
    int got10 = 0, got01 = 0;
    GetParam()->moments(image_.ptr(cy) + cx, stride_, &got10, &got01);
    EXPECT_EQ(got10, m10);
    EXPECT_EQ(got01, m01);

    PatchKernels::Tensor t = {};
    for (int y = cy - 3; y <= cy + 3; ++y) {
      for (int x = cx - 3; x <= cx + 3; ++x) {
        const int gx = at(x + 1, y - 1) + 2 * at(x + 1, y) + at(x + 1, y + 1) - at(x - 1, y - 1) - 2 * at(x - 1, y) -
                       at(x - 1, y + 1);
        const int gy = at(x - 1, y + 1) + 2 * at(x, y + 1) + at(x + 1, y + 1) - at(x - 1, y - 1) - 2 * at(x, y - 1) -
                       at(x + 1, y - 1);
        t.xx += gx * gx;
        t.xy += gx * gy;
        t.yy += gy * gy;
      }
    }
    const PatchKernels::Tensor got = GetParam()->tensor(image_.ptr(cy) + cx, stride_);
    EXPECT_EQ(got.xx, t.xx);
    EXPECT_EQ(got.xy, t.xy);
    EXPECT_EQ(got.yy, t.yy);
  }
}

INSTANTIATE_TEST_SUITE_P(Portable, Kernels, testing::Values(&PatchKernels::Portable()));
INSTANTIATE_TEST_SUITE_P(ThisProcessor, Kernels, testing::Values(&PatchKernels::Get()));

}  // namespace patch_kernels_test
}  // namespace mapmend
