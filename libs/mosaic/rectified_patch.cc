#include "libs/mosaic/rectified_patch.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace mapmend {
namespace {

constexpr int kStep = kRectifyStep;

// The pixels of one row of places, kStep apart, from the part's left to beyond its right.
void ProjectRow(const GroundView& view, const GroundSurface& surface, const GroundRaster& raster, const cv::Rect& part,
                int row, std::vector<cv::Point2f>* nodes) {
  nodes->clear();
  for (int column = 0; column < part.width + kStep; column += kStep) {
    const Eigen::Vector2d place = raster.Place(part.x + column, part.y + row);
    const auto sight = view.Project({place.x(), place.y(), surface.Height(place.x(), place.y())});
    nodes->emplace_back(sight ? static_cast<float>(sight->pixel.x()) : -1.0F,
                        sight ? static_cast<float>(sight->pixel.y()) : -1.0F);
  }
}

}  // namespace

cv::Mat Rectify(const cv::Mat& image, const GroundView& view, const GroundSurface& surface, const GroundRaster& raster,
                const cv::Rect& part) {
  cv::Mat pixels(part.size(), CV_32FC2);
  std::vector<cv::Point2f> above, below;
  ProjectRow(view, surface, raster, part, 0, &above);
  for (int top = 0; top < part.height; top += kStep) {
    ProjectRow(view, surface, raster, part, top + kStep, &below);
    for (int y = top; y < std::min(part.height, top + kStep); ++y) {
      const float down = static_cast<float>(y - top) / kStep;
      auto* line = pixels.ptr<cv::Point2f>(y);
      for (size_t n = 0; n + 1 < above.size(); ++n) {
        const cv::Point2f west = (1 - down) * above[n] + down * below[n];
        const cv::Point2f step = ((1 - down) * above[n + 1] + down * below[n + 1] - west) / static_cast<float>(kStep);
        const int left = static_cast<int>(n) * kStep, count = std::min(kStep, part.width - left);
        for (int x = 0; x < count; ++x) line[left + x] = west + static_cast<float>(x) * step;
      }
    }
    std::swap(above, below);
  }
  cv::Mat color;
  cv::remap(image, color, pixels, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return color;
}

}  // namespace mapmend
