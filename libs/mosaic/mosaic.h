#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/mosaic/ground_part.h"
#include "libs/mosaic/ground_scene.h"
#include "libs/mosaic/image_cache.h"
#include "libs/mosaic/rectified_patch.h"

// A picture of the ground from above, of the images of a map: orthorectified over the ground surface, evened in
// brightness, each place from the image that shows it best, seams blended.
namespace mapmend {

struct MosaicOptions {
  GroundSceneOptions scene;
  ExposureOptions exposure;
  double gsd = 0;                  // size of a pixel on the ground, units of the map; 0: the median of the images'
  double max_megapixels = 150;     // of the mosaic: the pixels become larger if needed
  int block = 1024;                // pixels, width and height of what is made at a time
  int blend_levels = 5;            // octaves; seams are as wide as the coarsest of them
  int max_cached_megabytes = 160;  // of decoded images

  template <typename Visitor>
  void Visit(Visitor& v) {
    scene.Visit(v);
    v("exposure", exposure);
    v("gsd", gsd, AtLeast(0), "units of the map; 0: the median of the images'");
    v("max_megapixels", max_megapixels, MoreThan(0));
    v("block", block, Range(64, 16384), "pixels");
    v("blend_levels", blend_levels, Range(kMinBlendLevels, kMaxBlendLevels), "octaves");
    v("max_cached_megabytes", max_cached_megabytes, Range(1, 1e6), "MB");
  }
};

// Where the picture goes, block by block, each pixel once.
//   color  8 bits, 3 channels
//   mask   8 bits, 255 where an image shows the ground
//   at     of the block in the raster
using WriteMosaicBlock = std::function<void(const cv::Mat& color, const cv::Mat& mask, const cv::Rect& at)>;

class Mosaic {
 public:
  // points: of the map, in the ground's frame. read: images of the size of their cameras.
  Mosaic(const MosaicOptions& options, std::vector<MosaicImage> images, const std::vector<Eigen::Vector3d>& points,
         ReadMosaicImage read);

  // Empty, or one sentence why these images are no picture of the ground.
  const std::string& Problem() const { return scene_.Problem(); }
  const GroundRaster& Raster() const { return raster_; }
  const GroundSurface& Surface() const { return scene_.Surface(); }
  // Only this part of the ground.
  void Crop(const GroundBounds& bounds);

  // Makes the picture. progress may be empty; it gets the share that is done.
  void Make(const WriteMosaicBlock& write, const std::function<void(double share)>& progress);

  int NumImages() const { return scene_.NumImages(); }
  int NumMissing() const { return num_missing_; }  // images that could not be read, once Make has tried
  // How many images show each place, at one pixel of this picture for `step` pixels of the raster; 16 bits.
  cv::Mat Coverage(int step) const;

 private:
  void ChooseRaster();
  void EvenExposure(const std::function<void(double share)>& tell);

  MosaicOptions options_;
  GroundScene scene_;
  ReadMosaicImage read_;
  GroundRaster raster_;
  int num_missing_ = 0;
};

}  // namespace mapmend
