#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "libs/features/features.h"
#include "libs/features/matching.h"

namespace cv {
class Mat;
}  // namespace cv

namespace mapmend {

// The image of a frame as it came: its JPEG, or else its pixels. Both null: not kept, or let go of.
struct OriginalImage {
  std::shared_ptr<const std::vector<uint8_t>> jpeg;
  std::shared_ptr<const cv::Mat> pixels;  // 8-bit BGR, BGRA or grey
  int width = 0, height = 0;              // pixels
};

// One image after feature extraction; const once made. Where it lies in a submap and what it sees of it is in its
// TrackResult, and in its WorkingKeyframe if it becomes one.
struct Frame {
  int index = -1;  // in the input
  int64_t utime = 0;
  double mean_brightness = 0;  // 0 to 255
  int num_unseen = 0;          // features left out, because the lens model has no place for them
  double sharpness = 0;        // mean absolute Laplacian, grey levels
  Features features;
  FeatureGrid grid;
  // Grey, for wide features; null: not kept, or let go of, which is all of a frame that ever changes.
  mutable std::shared_ptr<const cv::Mat> image;
  mutable OriginalImage original;  // until the frame is published as a keyframe; let go of as the grey one is
};

using FramePtr = std::shared_ptr<const Frame>;

}  // namespace mapmend
