#include "libs/mosaic/mosaic.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "libs/mosaic/brightness.h"

namespace mapmend {

Mosaic::Mosaic(const MosaicOptions& options, std::vector<MosaicImage> images,
               const std::vector<Eigen::Vector3d>& points, ReadMosaicImage read)
    : options_(options), scene_(options.scene, std::move(images), points), read_(std::move(read)) {
  if (Problem().empty()) ChooseRaster();
}

void Mosaic::ChooseRaster() {
  const GroundBounds bounds = scene_.Bounds();
  raster_.gsd = options_.gsd > 0 ? options_.gsd : scene_.Gsd();
  const double megapixels = bounds.Size().x() * bounds.Size().y() / (raster_.gsd * raster_.gsd) * 1e-6;
  if (megapixels > options_.max_megapixels) raster_.gsd *= std::sqrt(megapixels / options_.max_megapixels);
  Crop(bounds);
  // Images much finer than the raster are reduced when they are read.
  for (int i = 0; i < NumImages(); ++i) {
    constexpr double kMuchFiner = 0.67;
    const double share = scene_.Gsd(i) / raster_.gsd;
    if (share > 0 && share <= kMuchFiner) scene_.Reduce(i, share);
  }
}

void Mosaic::Crop(const GroundBounds& bounds) {
  raster_.north_west = {bounds.low.x(), bounds.high.y()};
  raster_.width = std::max(1, static_cast<int>(std::ceil(bounds.Size().x() / raster_.gsd)));
  raster_.height = std::max(1, static_cast<int>(std::ceil(bounds.Size().y() / raster_.gsd)));
}

void Mosaic::EvenExposure(ImageCache* cache, const std::function<void(double share)>& tell) {
  std::vector<cv::Mat> brightness(static_cast<size_t>(NumImages()));
  for (int i = 0; i < NumImages(); ++i) {
    const cv::Mat& image = cache->Get(i, SizeOf(scene_.Image(i).camera));
    if (image.empty()) {
      scene_.Exclude(i);
    } else {
      brightness[static_cast<size_t>(i)] = BrightnessImage(image);
    }
    tell(static_cast<double>(i + 1) / NumImages());
  }
  scene_.SetExposure(EvenBrightness(scene_, brightness, options_.exposure));
}

void Mosaic::Make(const WriteMosaicBlock& write, const std::function<void(double share)>& progress) {
  ImageCache cache(read_, options_.max_cached_megabytes);
  constexpr double kShareOfExposure = 0.2;
  const auto tell = [&](double share) {
    if (progress) progress(share);
  };
  EvenExposure(&cache, [&](double share) { tell(kShareOfExposure * share); });
  const int columns = (raster_.width + options_.block - 1) / options_.block,
            rows = (raster_.height + options_.block - 1) / options_.block;
  for (int row = 0; row < rows; ++row) {
    for (int n = 0; n < columns; ++n) {
      const int column = row % 2 == 0 ? n : columns - 1 - n;  // back and forth: neighbours share images
      const int x = column * options_.block, y = row * options_.block;
      const cv::Rect block(x, y, std::min(options_.block, raster_.width - x),
                           std::min(options_.block, raster_.height - y));
      const GroundPart part = MakeGroundPart(scene_, raster_, block, options_.blend_levels, &cache);
      if (!part.color.empty()) write(part.color, part.mask, block);
      tell(kShareOfExposure + (1 - kShareOfExposure) * (row * columns + n + 1) / (rows * columns));
    }
  }
  num_missing_ = static_cast<int>(cache.Missing().size());
}

cv::Mat Mosaic::Coverage(int step) const {
  cv::Mat coverage = cv::Mat::zeros((raster_.height + step - 1) / step, (raster_.width + step - 1) / step, CV_16U);
  for (int i = 0; i < NumImages(); ++i) {
    const GroundBounds& footprint = scene_.Footprint(i);
    const Eigen::Vector2d low = raster_.Pixel({footprint.low.x(), footprint.high.y()}) / step,
                          high = raster_.Pixel({footprint.high.x(), footprint.low.y()}) / step;
    const cv::Rect all({}, coverage.size());
    const cv::Rect part =
        cv::Rect(cv::Point(static_cast<int>(std::floor(low.x())), static_cast<int>(std::floor(low.y()))),
                 cv::Point(static_cast<int>(std::ceil(high.x())) + 1, static_cast<int>(std::ceil(high.y())) + 1)) &
        all;
    for (int row = part.y; row < part.br().y; ++row) {
      for (int column = part.x; column < part.br().x; ++column) {
        const Eigen::Vector2d place = raster_.Place((column + 0.5) * step, (row + 0.5) * step);
        if (scene_.View(i).See(scene_.OnSurface(place))) ++coverage.at<uint16_t>(row, column);
      }
    }
  }
  return coverage;
}

}  // namespace mapmend
