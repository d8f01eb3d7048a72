#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "libs/features/features.h"
#include "libs/features/matching.h"
#include "libs/stream/keyframe_images.h"

namespace cv {
class Mat;
}  // namespace cv

namespace mapmend {

// The image of a frame as it came: its JPEG, or else its pixels; or as it will be kept. All null: not kept, or let go
// of.
struct OriginalImage {
  std::shared_ptr<const std::vector<uint8_t>> jpeg;
  std::shared_ptr<const cv::Mat> pixels;  // 8-bit BGR, BGRA or grey
  int width = 0, height = 0;              // pixels
  std::shared_ptr<const KeyframeImage> encoded = nullptr;

  bool IsNone() const { return jpeg == nullptr && pixels == nullptr && encoded == nullptr; }
};

// The original of a frame, for as long as it may be wanted. Thread-safe.
class HeldOriginal {
 public:
  HeldOriginal() = default;
  HeldOriginal(const HeldOriginal& other) : image_(other.Get()) {}
  HeldOriginal& operator=(const HeldOriginal& other) {
    if (this != &other) Set(other.Get());
    return *this;
  }

  OriginalImage Get() const {
    const std::lock_guard lock(mutex_);
    return image_;
  }
  void Set(OriginalImage image) {
    const std::lock_guard lock(mutex_);
    image_ = std::move(image);
  }
  // The same image in another form, unless it was let go of.
  void Replace(OriginalImage image) {
    const std::lock_guard lock(mutex_);
    if (!image_.IsNone()) image_ = std::move(image);
  }
  void LetGo() { Set({}); }

 private:
  mutable std::mutex mutex_;
  OriginalImage image_;
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
  mutable std::shared_ptr<const cv::Mat> colors;  // each fourth pixel of each fourth row; as long as image
  mutable HeldOriginal original;  // until the frame is published as a keyframe; let go of as the grey one is
  // The same image with other features, which holds both images in this one's place; null: this one does.
  std::shared_ptr<const Frame> photo;
};

using FramePtr = std::shared_ptr<const Frame>;

inline void LetGoOfImage(const Frame& frame) { frame.image = frame.colors = nullptr; }

// The frame that holds the images of this one.
inline const FramePtr& HolderOf(const FramePtr& frame) { return frame->photo ? frame->photo : frame; }

}  // namespace mapmend
