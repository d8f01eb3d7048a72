#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "libs/mosaic/ground_scene.h"

namespace mapmend {

// An image so small that it tells the brightness of areas, not of leaves: 8 bits, 3 channels. An image whose longer
// side has kBrightnessSide pixels is enough for it.
constexpr int kBrightnessSide = 160;
cv::Mat BrightnessImage(const cv::Mat& image);

// Sets aside the images of the scene of which more than half is white or black: overexposed, or dark.
//   brightness  BrightnessImage of each image of the scene; empty: it is not used
void SetClippedAside(const std::vector<cv::Mat>& brightness, GroundScene* scene);

// What the images show at places all over the ground, for SolveExposure.
//   brightness  BrightnessImage of each image of the scene; empty: it is not used
//   num_places  about so many
std::vector<std::vector<BrightnessSample>> SampleBrightness(const GroundScene& scene,
                                                            const std::vector<cv::Mat>& brightness, int num_places);

// The gains that make the images agree.
Exposure EvenBrightness(const GroundScene& scene, const std::vector<cv::Mat>& brightness,
                        const ExposureOptions& options);

}  // namespace mapmend
