#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "libs/mosaic/ground_scene.h"
#include "libs/mosaic/rectified_patch.h"

namespace mapmend {

// Which image shows each place of a part of the ground.
struct ImageChoice {
  cv::Mat label;            // 16 bits, signed: the index of the image; -1 where none shows the place
  std::vector<int> images;  // that show any, ascending
};

// For each place the image that shows it best: the one that looks down most steeply, from nearest, and not with its
// border. Seams lie where two are equal, so cells are those of Voronoi if all look down from one height.
//   part  of the raster; begins at multiples of kChoiceStep
ImageChoice ChooseImages(const GroundScene& scene, const GroundRaster& raster, const cv::Rect& part);

// Pixels between the places at which images are compared; in between it is interpolated.
inline constexpr int kChoiceStep = 16;

// What a part of the raster covers.
GroundBounds BoundsOf(const GroundRaster& raster, const cv::Rect& part);

}  // namespace mapmend
