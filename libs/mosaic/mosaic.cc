#include "libs/mosaic/mosaic.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "libs/mosaic/brightness.h"

namespace mapmend {
namespace {

constexpr int kCoverageBlock = 8;  // cells along a side

// Adds one to each cell of a block that an image shows. places: of all cells, row by row. A block whose corners are
// well inside the image, or well outside, is not looked into.
void CountSeen(const GroundView& view, const std::vector<Eigen::Vector3d>& places, const cv::Rect& block,
               cv::Mat* coverage) {
  const auto see = [&](int x, int y) {
    return view.Project(places[static_cast<size_t>(y) * static_cast<size_t>(coverage->cols) + static_cast<size_t>(x)]);
  };
  const int right = block.br().x - 1, bottom = block.br().y - 1;
  const auto a = see(block.x, block.y), b = see(right, block.y), c = see(block.x, bottom), d = see(right, bottom);
  if (a && b && c && d) {
    const double size = std::max((a->pixel - d->pixel).norm(), (b->pixel - c->pixel).norm());
    if (std::max({a->inside, b->inside, c->inside, d->inside}) < -size) return;
    if (std::min({a->inside, b->inside, c->inside, d->inside}) > size) {
      cv::Mat cells = (*coverage)(block);
      cells += cv::Scalar(1);
      return;
    }
  }
  for (int y = block.y; y <= bottom; ++y) {
    for (int x = block.x; x <= right; ++x) {
      if (const auto sight = see(x, y); sight && sight->inside >= 0) ++coverage->at<uint16_t>(y, x);
    }
  }
}

}  // namespace

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

void Mosaic::EvenExposure(const std::function<void(double share)>& tell) {
  num_missing_ = 0;
  std::vector<cv::Mat> brightness(static_cast<size_t>(NumImages()));
  for (int i = 0; i < NumImages(); ++i) {
    const cv::Mat image = read_(i, kBrightnessSide);
    if (image.empty()) {
      scene_.Exclude(i);
      ++num_missing_;
    } else {
      brightness[static_cast<size_t>(i)] = BrightnessImage(image);
    }
    tell(static_cast<double>(i + 1) / NumImages());
  }
  SetClippedAside(brightness, &scene_);
  scene_.SetExposure(EvenBrightness(scene_, brightness, options_.exposure));
}

void Mosaic::Make(const WriteMosaicBlock& write, const std::function<void(double share)>& progress) {
  ImageCache cache(read_, options_.max_cached_megabytes);
  constexpr double kShareOfExposure = 0.2;
  const auto tell = [&](double share) {
    if (progress) progress(share);
  };
  EvenExposure([&](double share) { tell(kShareOfExposure * share); });
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
  num_missing_ += static_cast<int>(cache.Missing().size());
}

cv::Mat Mosaic::Coverage(int step) const {
  const cv::Size size((raster_.width + step - 1) / step, (raster_.height + step - 1) / step);
  std::vector<Eigen::Vector3d> places;
  places.reserve(static_cast<size_t>(size.area()));
  for (int row = 0; row < size.height; ++row) {
    for (int column = 0; column < size.width; ++column)
      places.push_back(scene_.OnSurface(raster_.Place((column + 0.5) * step, (row + 0.5) * step)));
  }
  cv::Mat coverage = cv::Mat::zeros(size, CV_16U);
  for (int i = 0; i < NumImages(); ++i) {
    const GroundBounds& footprint = scene_.Footprint(i);
    const Eigen::Vector2d low = raster_.Pixel({footprint.low.x(), footprint.high.y()}) / step,
                          high = raster_.Pixel({footprint.high.x(), footprint.low.y()}) / step;
    const cv::Rect cells =
        cv::Rect(cv::Point(static_cast<int>(std::floor(low.x())), static_cast<int>(std::floor(low.y()))),
                 cv::Point(static_cast<int>(std::ceil(high.x())) + 1, static_cast<int>(std::ceil(high.y())) + 1)) &
        cv::Rect({}, size);
    for (int y = cells.y; y < cells.br().y; y += kCoverageBlock) {
      for (int x = cells.x; x < cells.br().x; x += kCoverageBlock)
        CountSeen(scene_.View(i), places, cv::Rect(x, y, kCoverageBlock, kCoverageBlock) & cells, &coverage);
    }
  }
  return coverage;
}

}  // namespace mapmend
