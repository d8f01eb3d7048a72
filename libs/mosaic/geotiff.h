#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "libs/mosaic/rectified_patch.h"

namespace mapmend {

// A picture of the ground as a GeoTIFF, written block by block. While it is written it has another name; Finish makes a
// Cloud Optimized GeoTIFF of it (tiles, overviews, JPEG with a mask), which replaces what has its name.
class GeoTiffWriter {
 public:
  // epsg: of the raster's coordinates; 0: a local frame. Throws std::runtime_error with one line naming the file.
  GeoTiffWriter(const std::string& path, const GroundRaster& raster, int epsg);
  ~GeoTiffWriter();  // without Finish nothing is left behind
  GeoTiffWriter(const GeoTiffWriter&) = delete;
  GeoTiffWriter& operator=(const GeoTiffWriter&) = delete;

  // As WriteMosaicBlock. Throws std::runtime_error.
  void Write(const cv::Mat& color, const cv::Mat& mask, const cv::Rect& at);
  //   overlay  also as a super-overlay for Google Earth, a KMZ of this name; empty: not. On the earth only.
  void Finish(const std::string& overlay = "");

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Heights over the same ground as one band of 32-bit floats, also cloud optimized.
//   step    pixels of the raster for one of the heights
//   offset  from the frame of surface and raster to the coordinates of the file
void WriteHeights(const std::string& path, const GroundSurface& surface, const GroundRaster& raster, int step,
                  const Eigen::Vector3d& offset, int epsg);

}  // namespace mapmend
