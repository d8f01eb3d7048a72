#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "libs/mosaic/rectified_patch.h"

// Pictures of a mosaic for people: small ones, with a scale and an arrow to the north.
namespace mapmend {

// Collects the blocks of a mosaic at a fraction of its size.
class MosaicPreview {
 public:
  // max_dimension: of the picture, pixels.
  MosaicPreview(const GroundRaster& raster, int max_dimension);

  // As WriteMosaicBlock.
  void Add(const cv::Mat& color, const cv::Mat& mask, const cv::Rect& at);
  // 8 bits, 4 channels (BGRA), transparent where no image shows the ground.
  cv::Mat Picture() const;
  double Gsd() const { return gsd_; }  // of the picture

 private:
  double scale_;  // pixels of the picture for one of the raster
  double gsd_;
  cv::Mat sum_, weight_;
};

struct ScaleMarks {
  double gsd = 1;          // of the picture
  std::string unit = "";   // "m"; empty: lengths mean nothing, and there is no bar
  bool has_north = false;  // whether up is the north
};

// Draws a bar with its length, and the arrow, into the lower left corner of a picture of three or four channels.
void DrawScaleMarks(const ScaleMarks& marks, cv::Mat* picture);

// How many images show each place (16 bits) in colours from red (one) over yellow to blue (five and more), with a key;
// BGRA, transparent where none does.
cv::Mat CoveragePicture(const cv::Mat& coverage);

}  // namespace mapmend
