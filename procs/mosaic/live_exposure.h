#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "libs/mosaic/brightness.h"

namespace mapmend {

// Gains of the images of a growing map. They are worked out anew whenever the map has grown by a share; in between an
// image that comes has those of the one before it.
class LiveExposure {
 public:
  explicit LiveExposure(const ExposureOptions& options) : options_(options) {}

  // Sets the scene's exposure.
  //   name        of the part of the map
  //   brightness  of each image of the scene (BrightnessImage)
  //   is_final    worked out anew whatever there is
  void Apply(const std::string& name, const std::vector<cv::Mat>& brightness, bool is_final, GroundScene* scene);

 private:
  struct Part {
    int num_images = 0;                         // when it was worked out
    std::map<int, std::array<float, 3>> gains;  // by MosaicImage::id
    double a = 0, b = 0;
  };
  const ExposureOptions options_;
  std::map<std::string, Part> parts_;
};

}  // namespace mapmend
