#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "libs/mosaic/exposure.h"
#include "libs/mosaic/ground_surface.h"
#include "libs/mosaic/ground_view.h"
#include "libs/mosaic/rectified_patch.h"

// A picture of the ground from above, of the images of a map: orthorectified over the ground surface, evened in
// brightness, each place from the image that shows it best, with coarse structures blended and fine ones cut.
namespace mapmend {

struct MosaicOptions {
  GroundSurfaceOptions surface;
  ExposureOptions exposure;
  double gsd = 0;                  // size of a pixel on the ground, units of the map; 0: the median of the images'
  double max_tilt_deg = 60;        // of the optical axes' median from straight down; beyond, it is not the ground
  double max_megapixels = 150;     // of the mosaic: the pixels become larger if needed
  double max_relief = 0.5;         // of the height above the ground: median distance of points from the surface
  int block = 1024;                // pixels, width and height of what is made at a time
  int images_per_place = 4;        // that are blended
  double blend_px = 24;            // structures coarser than this are blended, finer ones cut
  int max_cached_megabytes = 160;  // of decoded images

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("surface", surface);
    v("exposure", exposure);
    v("gsd", gsd, AtLeast(0), "units of the map; 0: the median of the images'");
    v("max_tilt_deg", max_tilt_deg, Range(0, 90), "degrees");
    v("max_megapixels", max_megapixels, MoreThan(0));
    v("max_relief", max_relief, MoreThan(0), "of the height above the ground");
    v("block", block, Range(64, 16384), "pixels");
    v("images_per_place", images_per_place, Range(1, 100), "images");
    v("blend_px", blend_px, AtLeast(1), "pixels");
    v("max_cached_megabytes", max_cached_megabytes, Range(1, 1e6), "MB");
  }
};

struct MosaicImage {
  Camera camera;
  Rigid3 cam_from_ground;  // z of the ground's frame points up
};

// 8 bits, 3 channels (BGR), of the size of the image's camera; empty if it is not to be had.
using ReadMosaicImage = std::function<cv::Mat(int image)>;

// Where the picture goes, block by block, each pixel once.
//   color  8 bits, 3 channels
//   mask   8 bits, 255 where an image shows the ground
//   at     of the block in the raster
using WriteMosaicBlock = std::function<void(const cv::Mat& color, const cv::Mat& mask, const cv::Rect& at)>;

class Mosaic {
 public:
  // points: of the map, in the ground's frame.
  Mosaic(const MosaicOptions& options, std::vector<MosaicImage> images, const std::vector<Eigen::Vector3d>& points,
         ReadMosaicImage read);

  // Empty, or one sentence why these images are no picture of the ground.
  const std::string& Problem() const { return problem_; }
  const GroundRaster& Raster() const { return raster_; }
  const GroundSurface& Surface() const { return surface_; }
  // Only this part of the ground.
  void Crop(const GroundBounds& bounds);

  // Makes the picture. progress may be empty; it gets the share that is done.
  void Make(const WriteMosaicBlock& write, const std::function<void(double share)>& progress);

  int NumImages() const { return static_cast<int>(images_.size()); }
  int NumMissing() const { return num_missing_; }  // images that could not be read, once Make has tried
  // How many images show each place, at one pixel of this picture for `step` pixels of the raster; 16 bits.
  cv::Mat Coverage(int step) const;

 private:
  class Cache;

  void FitSurface(const std::vector<Eigen::Vector3d>& points);
  void ChooseRaster();
  std::vector<int> ImagesOf(const cv::Rect& block) const;
  void EvenExposure(Cache* cache);
  void MakeBlock(const cv::Rect& block, Cache* cache, const WriteMosaicBlock& write);

  MosaicOptions options_;
  std::vector<MosaicImage> images_;
  std::vector<GroundView> views_;
  std::vector<GroundBounds> footprints_;
  ReadMosaicImage read_;
  std::string problem_;
  GroundSurface surface_;
  GroundRaster raster_;
  Exposure exposure_;
  int num_missing_ = 0;
};

}  // namespace mapmend
