#include "libs/mosaic/mosaic.h"

#include <algorithm>
#include <cmath>
#include <list>
#include <opencv2/imgproc.hpp>
#include <set>
#include <unordered_map>

#include "libs/base/median.h"
#include "libs/base/text_format.h"
#include "libs/mosaic/blended_block.h"

namespace mapmend {
namespace {

constexpr int kPlacesForExposure = 1500;
constexpr int kChoiceStep = 64;  // pixels between the places at which the best images are chosen

double MedianHeight(const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> heights;
  heights.reserve(points.size());
  for (const Eigen::Vector3d& p : points) heights.push_back(p.z());
  return Median(std::move(heights));
}

bool Contains(const GroundBounds& bounds, const Eigen::Vector2d& place) {
  return (place.array() >= bounds.low.array()).all() && (place.array() <= bounds.high.array()).all();
}

GroundBounds BoundsOf(const std::vector<Eigen::Vector2d>& places) {
  GroundBounds bounds;
  if (!places.empty()) bounds.low = bounds.high = places.front();
  for (const Eigen::Vector2d& place : places) {
    bounds.low = bounds.low.cwiseMin(place);
    bounds.high = bounds.high.cwiseMax(place);
  }
  return bounds;
}

// Pixels of the raster, all around a few more. It begins where a square of Rectify does, whatever the block.
cv::Rect PixelsOf(const GroundBounds& bounds, const GroundRaster& raster) {
  const Eigen::Vector2d low = raster.Pixel({bounds.low.x(), bounds.high.y()}),
                        high = raster.Pixel({bounds.high.x(), bounds.low.y()});
  constexpr int kMore = kRectifyStep;
  const auto begin = [](double pixel) {
    return static_cast<int>(std::floor(pixel / kRectifyStep)) * kRectifyStep - kMore;
  };
  const cv::Point first(begin(low.x()), begin(low.y()));
  const cv::Point last(static_cast<int>(std::ceil(high.x())) + kMore, static_cast<int>(std::ceil(high.y())) + kMore);
  return {first, last};
}

}  // namespace

// Decoded images, in the size in which they are used, at most so much memory of them.
class Mosaic::Cache {
 public:
  Cache(const Mosaic& mosaic, int max_megabytes) : mosaic_(mosaic), max_bytes_(size_t{1000000} * max_megabytes) {}

  const cv::Mat& Get(int image) {
    const auto found = position_.find(image);
    if (found != position_.end()) {
      entries_.splice(entries_.begin(), entries_, found->second);
      return entries_.front().second;
    }
    cv::Mat read = mosaic_.read_(image);
    const Camera& camera = mosaic_.images_[image].camera;
    if (read.empty()) {
      missing_.insert(image);
    } else if (read.cols != camera.width || read.rows != camera.height) {
      cv::resize(read, read, {camera.width, camera.height}, 0, 0, cv::INTER_AREA);
    }
    bytes_ += read.total() * read.elemSize();
    entries_.emplace_front(image, std::move(read));
    position_[image] = entries_.begin();
    while (bytes_ > max_bytes_ && entries_.size() > 1) {
      bytes_ -= entries_.back().second.total() * entries_.back().second.elemSize();
      position_.erase(entries_.back().first);
      entries_.pop_back();
    }
    return entries_.front().second;
  }
  int NumMissing() const { return static_cast<int>(missing_.size()); }

 private:
  const Mosaic& mosaic_;
  const size_t max_bytes_;
  size_t bytes_ = 0;
  std::list<std::pair<int, cv::Mat>> entries_;  // used last first
  std::unordered_map<int, std::list<std::pair<int, cv::Mat>>::iterator> position_;
  std::set<int> missing_;
};

Mosaic::Mosaic(const MosaicOptions& options, std::vector<MosaicImage> images,
               const std::vector<Eigen::Vector3d>& points, ReadMosaicImage read)
    : options_(options), images_(std::move(images)), read_(std::move(read)) {
  if (images_.empty() || points.empty()) {
    problem_ = "the map has no keyframe or no point";
    return;
  }
  for (const MosaicImage& image : images_) views_.emplace_back(image.camera, image.cam_from_ground);
  std::vector<double> tilts;
  for (const GroundView& view : views_) tilts.push_back(view.Tilt() * 180 / M_PI);
  if (const double tilt = Median(std::move(tilts)); tilt > options_.max_tilt_deg) {
    problem_ = Format("the camera looks %.0f degrees away from the ground: there is no picture of it from above", tilt);
    return;
  }
  FitSurface(points);
  if (problem_.empty()) ChooseRaster();
}

void Mosaic::FitSurface(const std::vector<Eigen::Vector3d>& points) {
  surface_ = GroundSurface(MedianHeight(points));
  std::vector<Eigen::Vector2d> corners;
  std::vector<double> heights;
  for (const GroundView& view : views_) {
    const std::vector<Eigen::Vector2d> footprint = view.Footprint(surface_);
    corners.insert(corners.end(), footprint.begin(), footprint.end());
    heights.push_back(view.Center().z() - surface_.Height(view.Center().x(), view.Center().y()));
  }
  surface_ = GroundSurface(points, BoundsOf(corners), options_.surface);
  const double height = Median(std::move(heights));
  if (!(height > 0)) {
    problem_ = "the camera is below the ground: the map stands on its head, or shows no ground";
  } else if (surface_.MedianResidual() > options_.max_relief * height) {
    problem_ = Format("the points lie %.0f %% of the height above them away from any ground surface",
                      100 * surface_.MedianResidual() / height);
  }
}

void Mosaic::ChooseRaster() {
  std::vector<Eigen::Vector2d> corners;
  std::vector<double> distances;
  for (const GroundView& view : views_) {
    const std::vector<Eigen::Vector2d> footprint = view.Footprint(surface_);
    footprints_.push_back(BoundsOf(footprint));
    corners.insert(corners.end(), footprint.begin(), footprint.end());
    distances.push_back(view.GroundSampleDistance(surface_));
  }
  const GroundBounds bounds = BoundsOf(corners);
  raster_.gsd = options_.gsd > 0 ? options_.gsd : Median(distances);
  const double megapixels = bounds.Size().x() * bounds.Size().y() / (raster_.gsd * raster_.gsd) * 1e-6;
  if (megapixels > options_.max_megapixels) raster_.gsd *= std::sqrt(megapixels / options_.max_megapixels);
  Crop(bounds);
  // Images much finer than the raster are reduced when they are read.
  for (size_t i = 0; i < images_.size(); ++i) {
    constexpr double kMuchFiner = 0.67;
    const double share = distances[i] / raster_.gsd;
    if (!(share > 0) || share > kMuchFiner) continue;
    images_[i].camera = images_[i].camera.Scaled(share);
    views_[i] = GroundView(images_[i].camera, images_[i].cam_from_ground);
  }
}

void Mosaic::Crop(const GroundBounds& bounds) {
  raster_.north_west = {bounds.low.x(), bounds.high.y()};
  raster_.width = std::max(1, static_cast<int>(std::ceil(bounds.Size().x() / raster_.gsd)));
  raster_.height = std::max(1, static_cast<int>(std::ceil(bounds.Size().y() / raster_.gsd)));
}

// At places all over a block the images that show them best; in ascending order.
std::vector<int> Mosaic::ImagesOf(const cv::Rect& block) const {
  std::set<int> chosen;
  const Eigen::Vector2d north_west = raster_.Place(block.x, block.y),
                        south_east = raster_.Place(block.br().x, block.br().y);
  std::vector<int> near;
  for (size_t i = 0; i < views_.size(); ++i) {
    const GroundBounds& f = footprints_[i];
    if (f.high.x() >= north_west.x() && f.low.x() <= south_east.x() && f.high.y() >= south_east.y() &&
        f.low.y() <= north_west.y()) {
      near.push_back(static_cast<int>(i));
    }
  }
  for (int row = block.y; row < block.br().y + kChoiceStep; row += kChoiceStep) {
    for (int column = block.x; column < block.br().x + kChoiceStep; column += kChoiceStep) {
      const Eigen::Vector2d place = raster_.Place(column, row);
      const Eigen::Vector3d ground(place.x(), place.y(), surface_.Height(place.x(), place.y()));
      std::vector<std::pair<double, int>> by_quality;
      for (const int i : near) {
        if (!Contains(footprints_[i], place)) continue;
        if (const auto sight = views_[i].See(ground)) by_quality.emplace_back(-sight->quality, i);
      }
      std::sort(by_quality.begin(), by_quality.end());
      for (size_t k = 0; k < by_quality.size() && k < static_cast<size_t>(options_.images_per_place); ++k)
        chosen.insert(by_quality[k].second);
    }
  }
  return {chosen.begin(), chosen.end()};
}

void Mosaic::EvenExposure(Cache* cache) {
  const double area = static_cast<double>(raster_.width) * raster_.height;
  const double step = std::max(8.0, std::sqrt(area / kPlacesForExposure));
  std::vector<Eigen::Vector3d> places;
  for (double row = step / 2; row < raster_.height; row += step) {
    for (double column = step / 2; column < raster_.width; column += step) {
      const Eigen::Vector2d place = raster_.Place(column, row);
      places.emplace_back(place.x(), place.y(), surface_.Height(place.x(), place.y()));
    }
  }
  std::vector<std::vector<BrightnessSample>> samples(places.size());
  for (int i = 0; i < NumImages(); ++i) {
    const cv::Mat& image = cache->Get(i);
    if (image.empty()) continue;
    constexpr int kReduction = 8;  // brightness of an area, not of a leaf
    cv::Mat small;
    cv::resize(image, small, {std::max(1, image.cols / kReduction), std::max(1, image.rows / kReduction)}, 0, 0,
               cv::INTER_AREA);
    for (size_t p = 0; p < places.size(); ++p) {
      if (!Contains(footprints_[i], places[p].head<2>())) continue;
      const auto sight = views_[i].See(places[p]);
      if (!sight) continue;
      const int x = std::min(small.cols - 1, static_cast<int>(sight->pixel.x() / kReduction)),
                y = std::min(small.rows - 1, static_cast<int>(sight->pixel.y() / kReduction));
      const auto& color = small.at<cv::Vec3b>(y, x);
      samples[p].push_back({i,
                            {static_cast<float>(color[0]), static_cast<float>(color[1]), static_cast<float>(color[2])},
                            static_cast<float>(sight->offset)});
    }
  }
  exposure_ = SolveExposure(NumImages(), samples, options_.exposure);
}

void Mosaic::MakeBlock(const cv::Rect& block, Cache* cache, const WriteMosaicBlock& write) {
  const int margin = static_cast<int>(std::ceil(2 * options_.blend_px / kRectifyStep)) * kRectifyStep;
  const cv::Rect part(block.x - margin, block.y - margin, block.width + 2 * margin, block.height + 2 * margin);
  BlendedBlock blended(part.size(), options_.blend_px);
  bool any = false;
  for (const int i : ImagesOf(part)) {
    const cv::Mat& image = cache->Get(i);
    if (image.empty()) continue;
    const cv::Rect seen = PixelsOf(footprints_[i], raster_) & part;
    if (seen.empty()) continue;
    any = true;
    blended.Add(Rectify(image, views_[i], surface_, raster_, seen), seen - part.tl(), i, exposure_);
  }
  if (!any) return;
  cv::Mat color, mask;
  blended.Finish(&color, &mask);
  const cv::Rect inner(margin, margin, block.width, block.height);
  if (cv::countNonZero(mask(inner)) > 0) write(color(inner), mask(inner), block);
}

void Mosaic::Make(const WriteMosaicBlock& write, const std::function<void(double share)>& progress) {
  Cache cache(*this, options_.max_cached_megabytes);
  EvenExposure(&cache);
  constexpr double kShareOfExposure = 0.2;
  const auto tell = [&](double share) {
    if (progress) progress(share);
  };
  tell(kShareOfExposure);
  const int columns = (raster_.width + options_.block - 1) / options_.block,
            rows = (raster_.height + options_.block - 1) / options_.block;
  for (int row = 0; row < rows; ++row) {
    for (int n = 0; n < columns; ++n) {
      const int column = row % 2 == 0 ? n : columns - 1 - n;  // back and forth: neighbours share images
      const int x = column * options_.block, y = row * options_.block;
      MakeBlock({x, y, std::min(options_.block, raster_.width - x), std::min(options_.block, raster_.height - y)},
                &cache, write);
      tell(kShareOfExposure + (1 - kShareOfExposure) * (row * columns + n + 1) / (rows * columns));
    }
  }
  num_missing_ = cache.NumMissing();
}

cv::Mat Mosaic::Coverage(int step) const {
  cv::Mat coverage = cv::Mat::zeros((raster_.height + step - 1) / step, (raster_.width + step - 1) / step, CV_16U);
  for (int row = 0; row < coverage.rows; ++row) {
    for (int column = 0; column < coverage.cols; ++column) {
      const Eigen::Vector2d place = raster_.Place((column + 0.5) * step, (row + 0.5) * step);
      const Eigen::Vector3d ground(place.x(), place.y(), surface_.Height(place.x(), place.y()));
      for (size_t i = 0; i < views_.size(); ++i) {
        if (Contains(footprints_[i], place) && views_[i].See(ground)) ++coverage.at<uint16_t>(row, column);
      }
    }
  }
  return coverage;
}

}  // namespace mapmend
