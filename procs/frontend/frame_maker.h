#pragma once

#include "libs/features/orb_extractor.h"
#include "libs/geometry/camera.h"
#include "procs/frontend/frame.h"
#include "procs/frontend/image_source.h"

namespace mapmend {

// Turns images into frames: grey, features, undistortion, colours. Thread-safe, so that it may run ahead of tracking.
class FrameMaker {
 public:
  // camera: of images after scaling by scale.
  FrameMaker(const Camera& camera, double scale, const OrbOptions& options)
      : camera_(camera), scale_(scale), extractor_(options) {}

  // Throws std::runtime_error if the image's size is not the camera's.
  FramePtr Make(const SourceImage& image) const;

 private:
  Camera camera_;
  double scale_;
  OrbExtractor extractor_;
};

}  // namespace mapmend
