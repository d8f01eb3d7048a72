#include "libs/mosaic/blended_block.h"

#include <opencv2/imgproc.hpp>

namespace mapmend {
namespace {

// sum += weight * band, of 16-bit signed bands.
void AddWeighted(const cv::Mat& band, const cv::Mat& weight, cv::Mat sum, cv::Mat weights) {
  for (int y = 0; y < band.rows; ++y) {
    const auto* from = band.ptr<cv::Vec3s>(y);
    const auto* w = weight.ptr<float>(y);
    auto* to = sum.ptr<cv::Vec3f>(y);
    auto* all = weights.ptr<float>(y);
    for (int x = 0; x < band.cols; ++x) {
      if (w[x] <= 0) continue;
      for (int c = 0; c < 3; ++c) to[x][c] += w[x] * from[x][c];
      all[x] += w[x];
    }
  }
}

// The weighted mean; zero where nothing weighs.
cv::Mat Mean(const cv::Mat& sum, const cv::Mat& weights) {
  constexpr float kLeast = 1e-4F;
  cv::Mat mean = cv::Mat::zeros(sum.size(), CV_32FC3);
  for (int y = 0; y < sum.rows; ++y) {
    const auto* from = sum.ptr<cv::Vec3f>(y);
    const auto* w = weights.ptr<float>(y);
    auto* to = mean.ptr<cv::Vec3f>(y);
    for (int x = 0; x < sum.cols; ++x) {
      if (w[x] > kLeast) to[x] = from[x] * (1 / w[x]);
    }
  }
  return mean;
}

}  // namespace

BlendedBlock::BlendedBlock(const cv::Size& size, int levels) {
  cv::Size of_band = size;
  for (int i = 0; i <= levels; ++i) {
    bands_.push_back({cv::Mat::zeros(of_band, CV_32FC3), cv::Mat::zeros(of_band, CV_32F)});
    of_band = {of_band.width / 2, of_band.height / 2};
  }
}

void BlendedBlock::Add(const cv::Mat& color, const cv::Mat& mask, const cv::Rect& at) {
  cv::Mat image, weight;
  color.convertTo(image, CV_16SC3);
  mask.convertTo(weight, CV_32F, 1.0 / 255);
  cv::Rect where = at;
  for (size_t i = 0; i < bands_.size(); ++i) {
    cv::Mat band = image, coarser;
    if (i + 1 < bands_.size()) {
      cv::Mat expanded;
      cv::pyrDown(image, coarser);
      cv::pyrUp(coarser, expanded, image.size());
      cv::subtract(image, expanded, band);
    }
    AddWeighted(band, weight, bands_[i].sum(where), bands_[i].weight(where));
    if (coarser.empty()) break;
    image = coarser;
    cv::Mat weight_below;
    cv::pyrDown(weight, weight_below);
    weight = weight_below;
    where = {where.x / 2, where.y / 2, where.width / 2, where.height / 2};
  }
}

cv::Mat BlendedBlock::Finish() const {
  cv::Mat picture = Mean(bands_.back().sum, bands_.back().weight);
  for (size_t i = bands_.size() - 1; i-- > 0;) {
    cv::Mat expanded;
    cv::pyrUp(picture, expanded, bands_[i].sum.size());
    picture = expanded + Mean(bands_[i].sum, bands_[i].weight);
  }
  cv::Mat color;
  picture.convertTo(color, CV_8UC3);
  return color;
}

}  // namespace mapmend
