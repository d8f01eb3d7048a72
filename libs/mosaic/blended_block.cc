#include "libs/mosaic/blended_block.h"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace mapmend {
namespace {

// Colours as if all images had been exposed alike.
cv::Mat Evened(const RectifiedPatch& patch, int image, const Exposure& exposure) {
  cv::Mat color;
  patch.color.convertTo(color, CV_32FC3);
  const cv::Scalar gains(exposure.Correction(image, 0, 0), exposure.Correction(image, 1, 0),
                         exposure.Correction(image, 2, 0));
  cv::multiply(color, gains, color);
  if (exposure.a == 0 && exposure.b == 0) return color;
  const cv::Mat r2 = patch.offset.mul(patch.offset);
  cv::Mat vignetting = -exposure.a * r2 - exposure.b * r2.mul(r2);
  cv::exp(vignetting, vignetting);
  cv::Mat of_channels;
  cv::merge(std::vector<cv::Mat>(3, vignetting), of_channels);
  return color.mul(of_channels);
}

cv::Mat ThreeChannels(const cv::Mat& one) {
  cv::Mat three;
  cv::merge(std::vector<cv::Mat>(3, one), three);
  return three;
}

}  // namespace

BlendedBlock::BlendedBlock(const cv::Size& size, double blend_px)
    : kernel_(2 * static_cast<int>(std::lround(blend_px / 2)) + 1),
      coarse_(cv::Mat::zeros(size, CV_32FC3)),
      weight_(cv::Mat::zeros(size, CV_32F)),
      fine_(cv::Mat::zeros(size, CV_32FC3)),
      best_(cv::Mat::zeros(size, CV_32F)) {}

// Two passes of a box are nearly a Gaussian, and their cost does not depend on its width.
cv::Mat BlendedBlock::Smooth(const cv::Mat& values) const {
  cv::Mat smooth;
  cv::blur(values, smooth, {kernel_, kernel_}, {-1, -1}, cv::BORDER_REPLICATE);
  cv::blur(smooth, smooth, {kernel_, kernel_}, {-1, -1}, cv::BORDER_REPLICATE);
  return smooth;
}

void BlendedBlock::Add(const RectifiedPatch& patch, const cv::Rect& at, int image, const Exposure& exposure) {
  const cv::Mat seen = patch.quality > 0;
  cv::Mat color = Evened(patch, image, exposure);
  color.setTo(cv::Scalar::all(0), ~seen);
  cv::Mat share;
  seen.convertTo(share, CV_32F, 1.0 / 255);
  cv::Mat coarse;
  cv::divide(Smooth(color), ThreeChannels(cv::max(Smooth(share), 1e-6F)), coarse);
  const cv::Mat q2 = patch.quality.mul(patch.quality);
  const cv::Mat weight = q2.mul(q2);
  cv::Mat sum = coarse_(at), weights = weight_(at), fine = fine_(at), best = best_(at);
  sum += coarse.mul(ThreeChannels(weight));
  weights += weight;
  const cv::Mat better = patch.quality > best;
  cv::subtract(color, coarse, fine, better);
  patch.quality.copyTo(best, better);
}

void BlendedBlock::Finish(cv::Mat* color, cv::Mat* mask) const {
  *mask = best_ > 0;
  cv::Mat weight = weight_.clone();
  weight.setTo(1, ~*mask);
  cv::Mat blended;
  cv::divide(coarse_, ThreeChannels(weight), blended);
  blended += fine_;
  blended.convertTo(*color, CV_8UC3);
  color->setTo(cv::Scalar::all(0), ~*mask);
}

}  // namespace mapmend
