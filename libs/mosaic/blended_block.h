#pragma once

#include <opencv2/core.hpp>

#include "libs/mosaic/exposure.h"
#include "libs/mosaic/rectified_patch.h"

namespace mapmend {

// Several images of one part of the ground as one, in two bands (after P. Burt and E. Adelson, ACM TOG 1983): what is
// coarser than blend_px is the mean of all, each weighted by how well it shows the place; what is finer comes from the
// one that shows it best. So seams are hardly seen, and nothing is seen twice.
class BlendedBlock {
 public:
  BlendedBlock(const cv::Size& size, double blend_px);

  //   at     where the patch lies in the block
  //   image  its index in the exposure
  void Add(const RectifiedPatch& patch, const cv::Rect& at, int image, const Exposure& exposure);
  //   color  8 bits, 3 channels
  //   mask   8 bits, 255 where any image shows the ground
  void Finish(cv::Mat* color, cv::Mat* mask) const;

 private:
  cv::Mat Smooth(const cv::Mat& values) const;

  int kernel_;               // pixels, odd
  cv::Mat coarse_, weight_;  // sums
  cv::Mat fine_, best_;      // of the best image, and its quality
};

}  // namespace mapmend
