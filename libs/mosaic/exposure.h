#pragma once

#include <array>
#include <vector>

#include "libs/base/range.h"

namespace mapmend {

struct ExposureOptions {
  double prior_sigma = 1.0;       // of the logarithm of a gain: keeps the mosaic as bright as its images are on average
  double vignetting_sigma = 0.3;  // of the coefficients of the vignetting
  double huber = 0.1;             // of the difference of two logarithms of brightness; beyond, things differ, not light
  int num_rounds = 5;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("prior_sigma", prior_sigma, MoreThan(0));
    v("vignetting_sigma", vignetting_sigma, MoreThan(0));
    v("huber", huber, MoreThan(0));
    v("num_rounds", num_rounds, Range(1, 100));
  }
};

// What is darker or brighter, 0 to 255, is clipped, and tells no gain.
inline constexpr float kDarkest = 8, kBrightest = 247;

// One place of the ground in one image.
struct BrightnessSample {
  int image = -1;
  std::array<float, 3> color = {};  // 0 to 255
  float offset = 0;                 // from the image's centre, of half its diagonal
};

// The gains that make images agree where they overlap: observed = light * gain * (1 + a r^2 + b r^4), with a gain for
// each image and channel and one vignetting for all, r the offset from the image's centre.
struct Exposure {
  std::vector<std::array<float, 3>> gains;  // by image
  double a = 0, b = 0;

  // What to multiply a channel of an image with, but for the vignetting.
  float Correction(int image, int channel) const {
    return 1 / gains[static_cast<size_t>(image)][static_cast<size_t>(channel)];
  }
  // How bright an image is at an offset, in comparison with its centre.
  float Vignetting(float offset) const;
};

// Robust least squares on logarithms. places: for each place of the ground the images that show it, two or more.
Exposure SolveExposure(int num_images, const std::vector<std::vector<BrightnessSample>>& places,
                       const ExposureOptions& options);

}  // namespace mapmend
