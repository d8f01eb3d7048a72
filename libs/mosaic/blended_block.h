#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace mapmend {

// Several images of one part of the ground as one: P. Burt's and E. Adelson's multiresolution spline (ACM TOG 1983).
// Each image is taken apart into bands of an octave; bands are joined along the seam over about the length of what they
// hold, so that brightness changes softly and edges stay sharp.
class BlendedBlock {
 public:
  // levels: bands but the coarsest. size: multiples of 2^levels.
  BlendedBlock(const cv::Size& size, int levels);

  // Images may overlap, masks may not.
  //   color  8 bits, 3 channels
  //   mask   8 bits, 255 where this image is to be seen
  //   at     where the two lie in the block; multiples of 2^levels
  void Add(const cv::Mat& color, const cv::Mat& mask, const cv::Rect& at);
  // 8 bits, 3 channels; says nothing where no mask was.
  cv::Mat Finish() const;

 private:
  struct Band {
    cv::Mat sum, weight;  // 32-bit float, 3 channels and 1
  };
  std::vector<Band> bands_;  // finest first
};

}  // namespace mapmend
