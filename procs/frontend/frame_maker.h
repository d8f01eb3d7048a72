#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "libs/capture/image_stream.h"
#include "libs/features/orb_extractor.h"
#include "libs/features/wide_features.h"
#include "libs/geometry/camera.h"
#include "procs/frontend/frame.h"

namespace mapmend {

// Turns images into frames: grey, features, undistortion, colours. Thread-safe, so that it may run ahead of tracking.
class FrameMaker {
 public:
  // camera: of the images as they come.  scaled: the same after scaling to its width and height.  mask: of that size,
  // 0 where no feature may be; null: none.  keep_images: frames hold their grey image.
  // keep_originals: and the image as it came.
  FrameMaker(const Camera& camera, const Camera& scaled, const OrbOptions& options,
             std::shared_ptr<const cv::Mat> mask = nullptr, bool keep_images = false, bool keep_originals = false)
      : input_width_(camera.width),
        input_height_(camera.height),
        camera_(scaled),
        extractor_(options),
        mask_(std::move(mask)),
        keep_images_(keep_images),
        keep_originals_(keep_originals) {}

  // Throws std::runtime_error if the image's size is not the camera's.
  FramePtr Make(const SourceImage& image) const;
  // Of the image of a frame, undistorted.
  WideFeatures ExtractWide(const cv::Mat& image, const WideExtractionOptions& options) const;
  // The same photo, which must hold its image, with the signatures of wide features in place of ORB's.
  FramePtr WithWideFeatures(const FramePtr& photo, const WideExtractionOptions& options) const;

 private:
  // distorted: where the features are in the image as it came.
  WideFeatures ExtractWide(const cv::Mat& image, const WideExtractionOptions& options,
                           std::vector<Eigen::Vector2f>* distorted) const;

  int input_width_, input_height_;
  Camera camera_;
  OrbExtractor extractor_;
  std::shared_ptr<const cv::Mat> mask_;
  bool keep_images_, keep_originals_;
};

}  // namespace mapmend
