#include "libs/mosaic/mosaic_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "libs/base/text_format.h"

namespace mapmend {
namespace {

const cv::Scalar kInk(30, 30, 30, 255), kPaper(255, 255, 255, 255);

// Dark on a light rim, readable on any ground.
void Write(const std::string& text, const cv::Point& at, double size, cv::Mat* picture) {
  cv::putText(*picture, text, at, cv::FONT_HERSHEY_SIMPLEX, size, kPaper, 4, cv::LINE_AA);
  cv::putText(*picture, text, at, cv::FONT_HERSHEY_SIMPLEX, size, kInk, 1, cv::LINE_AA);
}

void Line(const cv::Point& a, const cv::Point& b, cv::Mat* picture) {
  cv::line(*picture, a, b, kPaper, 5, cv::LINE_AA);
  cv::line(*picture, a, b, kInk, 2, cv::LINE_AA);
}

// The largest of 1, 2, 5, 10, ... that is not longer.
double RoundLength(double longest) {
  const double power = std::pow(10, std::floor(std::log10(longest)));
  for (const double digit : {5.0, 2.0}) {
    if (digit * power <= longest) return digit * power;
  }
  return power;
}

// Colour-blind safe, from few images to many.
const std::array<cv::Vec4b, 5> kSteps = {cv::Vec4b(38, 39, 165, 235), cv::Vec4b(67, 109, 244, 235),
                                         cv::Vec4b(139, 224, 254, 235), cv::Vec4b(233, 217, 171, 235),
                                         cv::Vec4b(180, 117, 69, 235)};

}  // namespace

MosaicPreview::MosaicPreview(const GroundRaster& raster, int max_dimension)
    : scale_(std::min(1.0, static_cast<double>(max_dimension) / std::max(raster.width, raster.height))),
      gsd_(raster.gsd / scale_),
      sum_(cv::Mat::zeros(std::max(1, static_cast<int>(std::ceil(raster.height * scale_))),
                          std::max(1, static_cast<int>(std::ceil(raster.width * scale_))), CV_32FC3)),
      weight_(cv::Mat::zeros(sum_.size(), CV_32F)) {}

void MosaicPreview::Add(const cv::Mat& color, const cv::Mat& mask, const cv::Rect& at) {
  for (int row = 0; row < color.rows; ++row) {
    const int y = std::min(sum_.rows - 1, static_cast<int>((at.y + row) * scale_));
    for (int column = 0; column < color.cols; ++column) {
      if (mask.at<uint8_t>(row, column) == 0) continue;
      const int x = std::min(sum_.cols - 1, static_cast<int>((at.x + column) * scale_));
      const auto& pixel = color.at<cv::Vec3b>(row, column);
      auto& sum = sum_.at<cv::Vec3f>(y, x);
      for (int c = 0; c < 3; ++c) sum[c] += pixel[c];
      weight_.at<float>(y, x) += 1;
    }
  }
}

cv::Mat MosaicPreview::Picture() const {
  cv::Mat picture = cv::Mat::zeros(sum_.size(), CV_8UC4);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const float weight = weight_.at<float>(y, x);
      if (weight == 0) continue;
      const auto& sum = sum_.at<cv::Vec3f>(y, x);
      picture.at<cv::Vec4b>(y, x) = {cv::saturate_cast<uint8_t>(sum[0] / weight),
                                     cv::saturate_cast<uint8_t>(sum[1] / weight),
                                     cv::saturate_cast<uint8_t>(sum[2] / weight), 255};
    }
  }
  return picture;
}

void DrawScaleMarks(const ScaleMarks& marks, cv::Mat* picture) {
  const int margin = 18, bottom = picture->rows - margin;
  int left = margin;
  if (marks.has_north) {
    constexpr int kHalf = 9, kHeight = 44;
    const cv::Point tip(left + kHalf, bottom - kHeight), foot(left + kHalf, bottom);
    Line(tip, foot, picture);
    Line(tip, tip + cv::Point(-kHalf, 2 * kHalf), picture);
    Line(tip, tip + cv::Point(kHalf, 2 * kHalf), picture);
    Write("N", tip + cv::Point(-6, -6), 0.6, picture);
    left += 4 * kHalf;
  }
  if (marks.unit.empty()) return;
  const double length = RoundLength(0.25 * picture->cols * marks.gsd);
  const int pixels = static_cast<int>(std::lround(length / marks.gsd));
  Line({left, bottom}, {left + pixels, bottom}, picture);
  for (const int x : {left, left + pixels}) Line({x, bottom - 5}, {x, bottom + 5}, picture);
  Write(length >= 1000 ? Format("%g km", length / 1000) : Format("%g ", length) + marks.unit, {left, bottom - 12}, 0.55,
        picture);
}

cv::Mat CoveragePicture(const cv::Mat& coverage) {
  cv::Mat picture = cv::Mat::zeros(coverage.size(), CV_8UC4);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const int count = coverage.at<uint16_t>(y, x);
      if (count > 0) picture.at<cv::Vec4b>(y, x) = kSteps[std::min<size_t>(kSteps.size(), count) - 1];
    }
  }
  constexpr int kRow = 24, kBox = 16;
  for (size_t i = 0; i < kSteps.size(); ++i) {
    const cv::Point corner(12, 12 + kRow * static_cast<int>(i));
    if (corner.y + kBox > picture.rows || corner.x + 6 * kBox > picture.cols) break;
    cv::rectangle(picture, {corner, cv::Size(kBox, kBox)}, cv::Scalar(kSteps[i]), cv::FILLED);
    cv::rectangle(picture, {corner, cv::Size(kBox, kBox)}, kInk, 1);
    const bool last = i + 1 == kSteps.size();
    Write(std::to_string(i + 1) + (last     ? "+ images"
                                   : i == 0 ? " image"
                                            : " images"),
          corner + cv::Point(kBox + 8, 13), 0.45, &picture);
  }
  return picture;
}

}  // namespace mapmend
