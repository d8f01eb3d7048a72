#pragma once

#include <opencv2/core.hpp>

#include "libs/mosaic/ground_scene.h"
#include "libs/mosaic/image_cache.h"
#include "libs/mosaic/rectified_patch.h"

namespace mapmend {

// A part of the picture of the ground.
struct GroundPart {
  cv::Mat color;  // 8 bits, 3 channels
  cv::Mat mask;   // 8 bits, 255 where an image shows the ground
};

// Chooses the images, rectifies them and blends them along their seams. Parts that are made one by one fit together: a
// part is made with a margin around it, on a lattice that begins at pixel (0, 0) of the raster.
//   part    of the raster
//   levels  of the blending: seams are as wide as 2^levels pixels
// Empty if no image shows anything. An image that cannot be read leaves a hole: exclude it first.
GroundPart MakeGroundPart(const GroundScene& scene, const GroundRaster& raster, const cv::Rect& part, int levels,
                          ImageCache* cache);

// The least levels and the most that there may be.
inline constexpr int kMinBlendLevels = 1, kMaxBlendLevels = 8;

}  // namespace mapmend
