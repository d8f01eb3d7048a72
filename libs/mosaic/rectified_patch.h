#pragma once

#include <opencv2/core.hpp>

#include "libs/mosaic/ground_view.h"

namespace mapmend {

// The raster of a picture of the ground: pixel (0, 0) is the north-west corner, x to the east, y to the south.
struct GroundRaster {
  Eigen::Vector2d north_west = Eigen::Vector2d::Zero();  // outer corner of the first pixel
  double gsd = 1;                                        // width of a pixel on the ground
  int width = 0, height = 0;
  double stretch = 1;  // height of a pixel on the ground, of its width

  // Centre of a pixel.
  Eigen::Vector2d Place(double column, double row) const {
    return {north_west.x() + (column + 0.5) * gsd, north_west.y() - (row + 0.5) * gsd * stretch};
  }
  Eigen::Vector2d Pixel(const Eigen::Vector2d& place) const {
    return {(place.x() - north_west.x()) / gsd - 0.5, (north_west.y() - place.y()) / (gsd * stretch) - 0.5};
  }
};

// Pixels between the places that Rectify projects.
inline constexpr int kRectifyStep = 8;

// A part of the ground as one image shows it, by backward projection: 8 bits, 3 channels. The projection is worked out
// at every eighth pixel and is linear between: the surface is smoother than that. Where the image shows nothing, the
// colours of its border go on.
//   image  8 bits, 3 channels, of the size of the view's camera
//   part   of the raster
cv::Mat Rectify(const cv::Mat& image, const GroundView& view, const GroundSurface& surface, const GroundRaster& raster,
                const cv::Rect& part);

}  // namespace mapmend
