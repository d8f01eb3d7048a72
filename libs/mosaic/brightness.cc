#include "libs/mosaic/brightness.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mapmend {
namespace {

// The share of an image's pixels of which all channels are at one end of their range.
double ClippedShare(const cv::Mat& image) {
  cv::Mat white, black;
  cv::inRange(image, cv::Scalar::all(kBrightest), cv::Scalar::all(255), white);
  cv::inRange(image, cv::Scalar::all(0), cv::Scalar::all(kDarkest), black);
  return (cv::countNonZero(white) + cv::countNonZero(black)) / static_cast<double>(image.total());
}

}  // namespace

cv::Mat BrightnessImage(const cv::Mat& image) {
  constexpr double kLongerSide = 80;  // pixels
  const double share = std::min(1.0, kLongerSide / std::max(image.cols, image.rows));
  cv::Mat small;
  cv::resize(image, small,
             {std::max(1, static_cast<int>(std::lround(share * image.cols))),
              std::max(1, static_cast<int>(std::lround(share * image.rows)))},
             0, 0, cv::INTER_AREA);
  return small;
}

void SetClippedAside(const std::vector<cv::Mat>& brightness, GroundScene* scene) {
  constexpr double kMost = 0.5;
  for (int i = 0; i < scene->NumImages(); ++i) {
    const cv::Mat& image = brightness[static_cast<size_t>(i)];
    if (!image.empty() && ClippedShare(image) > kMost) scene->SetAside(i);
  }
}

std::vector<std::vector<BrightnessSample>> SampleBrightness(const GroundScene& scene,
                                                            const std::vector<cv::Mat>& brightness, int num_places) {
  const GroundBounds bounds = scene.Bounds();
  const Eigen::Vector2d size = bounds.Size();
  const double step = std::max(std::sqrt(size.x() * size.y() / num_places), 1e-12);
  std::vector<Eigen::Vector3d> places;
  for (double y = bounds.low.y() + step / 2; y < bounds.high.y(); y += step) {
    for (double x = bounds.low.x() + step / 2; x < bounds.high.x(); x += step)
      places.push_back(scene.OnSurface({x, y}));
  }
  std::vector<std::vector<BrightnessSample>> samples(places.size());
  for (int i = 0; i < scene.NumImages(); ++i) {
    const cv::Mat& small = brightness[static_cast<size_t>(i)];
    if (small.empty()) continue;
    const GroundView& view = scene.View(i);
    const double shrink_x = static_cast<double>(small.cols) / view.camera().width,
                 shrink_y = static_cast<double>(small.rows) / view.camera().height;
    for (size_t p = 0; p < places.size(); ++p) {
      if (!Contains(scene.Footprint(i), places[p].head<2>())) continue;
      const auto sight = view.See(places[p]);
      if (!sight) continue;
      const int x = std::min(small.cols - 1, static_cast<int>(sight->pixel.x() * shrink_x)),
                y = std::min(small.rows - 1, static_cast<int>(sight->pixel.y() * shrink_y));
      const auto& color = small.at<cv::Vec3b>(y, x);
      samples[p].push_back({i,
                            {static_cast<float>(color[0]), static_cast<float>(color[1]), static_cast<float>(color[2])},
                            static_cast<float>(sight->offset)});
    }
  }
  return samples;
}

Exposure EvenBrightness(const GroundScene& scene, const std::vector<cv::Mat>& brightness,
                        const ExposureOptions& options) {
  // A few places for each image, however much of the ground is beside them.
  const int num_places = std::clamp(20 * scene.NumImages(), 1500, 20000);
  return SolveExposure(scene.NumImages(), SampleBrightness(scene, brightness, num_places), options);
}

}  // namespace mapmend
