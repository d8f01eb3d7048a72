#pragma once

#include <string>

namespace mapmend::simulate {

// How an aerial sequence looks to a SLAM system, to compare simulated with real ones. The ground is taken as the plane
// z = ground_height, which is good enough for overlaps and for telling right matches from wrong ones.
struct MeasureOptions {
  std::string video, camera, truth;  // a video, its calibration, world_from_camera per frame (TUM)
  std::string vocabulary;            // empty: no BoW scores
  double ground_height = 0;          // metres
  int every = 4;                     // frames between two measured ones
  int num_features = 1000;
};

// JSON text: median FAST corners (threshold 20) per megapixel; of the features in the common ground of two frames, the
// share that is matched rightly (mutual nearest descriptor within 5 % of the image width of its place), by distance
// over height; mean BoW score by overlap. Throws std::runtime_error with one line naming the file.
std::string Measure(const MeasureOptions& options);

}  // namespace mapmend::simulate
