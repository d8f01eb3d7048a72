#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "libs/features/features.h"
#include "libs/features/matching.h"
#include "libs/geometry/rigid3.h"

namespace cv {
class Mat;
}  // namespace cv

namespace mapmend {

// One image after feature extraction. points is filled by tracking: per feature the index of the observed point in the
// working map, -1 without.
struct Frame {
  int index = -1;  // in the input
  int64_t utime = 0;
  double mean_brightness = 0;  // 0 to 255
  int num_unseen = 0;          // features left out, because the lens model has no place for them
  double sharpness = 0;        // mean absolute Laplacian, grey levels
  Features features;
  FeatureGrid grid;
  std::shared_ptr<const cv::Mat> image;  // grey, for wide features; null: not kept, or let go of
  std::vector<int> points;
  Rigid3 cam_from_submap;
};

using FramePtr = std::shared_ptr<Frame>;

}  // namespace mapmend
