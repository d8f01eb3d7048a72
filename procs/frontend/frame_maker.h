#pragma once

#include "libs/capture/image_stream.h"
#include "libs/features/orb_extractor.h"
#include "libs/geometry/camera.h"
#include "procs/frontend/frame.h"

namespace mapmend {

// Turns images into frames: grey, features, undistortion, colours. Thread-safe, so that it may run ahead of tracking.
class FrameMaker {
 public:
  // camera: of the images as they come.  scaled: the same after scaling to its width and height.
  FrameMaker(const Camera& camera, const Camera& scaled, const OrbOptions& options)
      : input_width_(camera.width), input_height_(camera.height), camera_(scaled), extractor_(options) {}

  // Throws std::runtime_error if the image's size is not the camera's.
  FramePtr Make(const SourceImage& image) const;

 private:
  int input_width_, input_height_;
  Camera camera_;
  OrbExtractor extractor_;
};

}  // namespace mapmend
