#include "libs/mosaic/ground_part.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "libs/mosaic/blended_block.h"
#include "libs/mosaic/image_choice.h"

namespace mapmend {
namespace {

int RoundDown(int value, int step) {
  const int rest = value % step;
  return value - (rest < 0 ? rest + step : rest);
}

// Grown by a margin, and to multiples of a step.
cv::Rect Grown(const cv::Rect& rect, int margin, int step) {
  const cv::Point low(RoundDown(rect.x - margin, step), RoundDown(rect.y - margin, step));
  const cv::Point high(-RoundDown(-(rect.br().x + margin), step), -RoundDown(-(rect.br().y + margin), step));
  return {low, high};
}

// Colours as if all images had been exposed alike, the vignetting taken out.
void Even(const GroundScene& scene, const GroundRaster& raster, const cv::Rect& part, int image, cv::Mat* color) {
  const Exposure& exposure = scene.GetExposure();
  if (exposure.gains.empty()) return;
  cv::Mat nodes(part.height / kRectifyStep + 1, part.width / kRectifyStep + 1, CV_32F);
  for (int row = 0; row < nodes.rows; ++row) {
    for (int column = 0; column < nodes.cols; ++column) {
      constexpr double kMiddle = (kRectifyStep - 1) / 2.0;  // as cv::resize has it
      const auto sight = scene.View(image).Project(scene.OnSurface(
          raster.Place(part.x + column * kRectifyStep + kMiddle, part.y + row * kRectifyStep + kMiddle)));
      const auto offset = sight ? static_cast<float>(std::min(sight->offset, 1.0)) : 1.0F;
      nodes.at<float>(row, column) = exposure.Vignetting(offset);
    }
  }
  cv::Mat factors;
  cv::resize(nodes, factors, {}, kRectifyStep, kRectifyStep, cv::INTER_LINEAR);
  std::array<float, 3> gains = {};
  for (int c = 0; c < 3; ++c) gains[static_cast<size_t>(c)] = exposure.Correction(image, c);
  for (int y = 0; y < part.height; ++y) {
    auto* pixel = color->ptr<cv::Vec3b>(y);
    const auto* factor = factors.ptr<float>(y);
    for (int x = 0; x < part.width; ++x) {
      for (int c = 0; c < 3; ++c)
        pixel[x][c] = cv::saturate_cast<uint8_t>(pixel[x][c] * gains[static_cast<size_t>(c)] / factor[x]);
    }
  }
}

}  // namespace

GroundPart MakeGroundPart(const GroundScene& scene, const GroundRaster& raster, const cv::Rect& part, int levels,
                          ImageCache* cache) {
  const int step = std::max(1 << levels, std::lcm(kChoiceStep, kRectifyStep)), margin = 2 << levels;
  const cv::Rect whole = Grown(part, margin, step);
  const ImageChoice choice = ChooseImages(scene, raster, whole);
  GroundPart made;
  if (choice.images.empty()) return made;
  BlendedBlock blended(whole.size(), levels);
  cv::Mat shown = cv::Mat::zeros(whole.size(), CV_8U);
  for (const int image : choice.images) {
    const cv::Mat& pixels = cache->Get(scene.Image(image).id, SizeOf(scene.Image(image).camera));
    if (pixels.empty()) continue;
    const cv::Mat mask = choice.label == image;
    const cv::Rect at = Grown(cv::boundingRect(mask), margin, step) & cv::Rect({}, whole.size());
    const cv::Rect in_raster = at + whole.tl();
    cv::Mat color = Rectify(pixels, scene.View(image), scene.Surface(), raster, in_raster);
    Even(scene, raster, in_raster, image, &color);
    blended.Add(color, mask(at), at);
    shown |= mask;
  }
  const cv::Rect inner(part.tl() - whole.tl(), part.size());
  if (cv::countNonZero(shown(inner)) == 0) return made;
  made.color = blended.Finish()(inner).clone();
  made.mask = shown(inner).clone();
  made.color.setTo(cv::Scalar::all(0), ~made.mask);
  return made;
}

}  // namespace mapmend
