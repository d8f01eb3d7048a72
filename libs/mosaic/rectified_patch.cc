#include "libs/mosaic/rectified_patch.h"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>

namespace mapmend {
namespace {

constexpr int kStep = kRectifyStep;

// What is known at a place that is projected.
using Node = std::array<float, 4>;  // pixel x, y, quality, offset; quality 0: not seen

Node Mix(const Node& a, const Node& b, float share) {
  Node mixed;
  for (size_t i = 0; i < mixed.size(); ++i) mixed[i] = (1 - share) * a[i] + share * b[i];
  return mixed;
}

// The nodes of one row, kStep apart, from the part's left to beyond its right.
std::vector<Node> ProjectRow(const GroundView& view, const GroundSurface& surface, const GroundRaster& raster,
                             const cv::Rect& part, int row) {
  std::vector<Node> nodes;
  for (int column = 0; column < part.width + kStep; column += kStep) {
    const Eigen::Vector2d place = raster.Place(part.x + column, part.y + row);
    const auto sight = view.See({place.x(), place.y(), surface.Height(place.x(), place.y())});
    if (!sight) {
      nodes.push_back({});
      continue;
    }
    nodes.push_back({static_cast<float>(sight->pixel.x()), static_cast<float>(sight->pixel.y()),
                     static_cast<float>(sight->quality), static_cast<float>(sight->offset)});
  }
  return nodes;
}

}  // namespace

RectifiedPatch Rectify(const cv::Mat& image, const GroundView& view, const GroundSurface& surface,
                       const GroundRaster& raster, const cv::Rect& part) {
  RectifiedPatch patch;
  cv::Mat map_x(part.size(), CV_32F, cv::Scalar(-1)), map_y(part.size(), CV_32F, cv::Scalar(-1));
  patch.quality = cv::Mat::zeros(part.size(), CV_32F);
  patch.offset = cv::Mat::zeros(part.size(), CV_32F);
  std::vector<Node> above = ProjectRow(view, surface, raster, part, 0), below;
  bool any = false;
  for (int top = 0; top < part.height; top += kStep) {
    below = ProjectRow(view, surface, raster, part, top + kStep);
    for (size_t n = 0; n + 1 < above.size(); ++n) {
      const int left = static_cast<int>(n) * kStep;
      // At the image's border only whole squares count: half a square is some pixels.
      if (above[n][2] <= 0 || above[n + 1][2] <= 0 || below[n][2] <= 0 || below[n + 1][2] <= 0) continue;
      any = true;
      for (int y = top; y < std::min(part.height, top + kStep); ++y) {
        const float down = static_cast<float>(y - top) / kStep;
        const Node west = Mix(above[n], below[n], down), east = Mix(above[n + 1], below[n + 1], down);
        for (int x = left; x < std::min(part.width, left + kStep); ++x) {
          const Node node = Mix(west, east, static_cast<float>(x - left) / kStep);
          map_x.at<float>(y, x) = node[0];
          map_y.at<float>(y, x) = node[1];
          patch.quality.at<float>(y, x) = node[2];
          patch.offset.at<float>(y, x) = node[3];
        }
      }
    }
    std::swap(above, below);
  }
  if (any) {
    cv::remap(image, patch.color, map_x, map_y, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar::all(0));
  } else {
    patch.color = cv::Mat::zeros(part.size(), CV_8UC3);
  }
  return patch;
}

}  // namespace mapmend
