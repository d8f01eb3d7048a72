#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <optional>
#include <utility>

#include "libs/capture/image_stream.h"

namespace mapmend {

// The images of a flight that goes on: of a file, those before the first that is wanted are passed over; a camera that
// was started again together with us may count and time its images from the beginning, and is continued.
class ResumedImages : public ImageStream {
 public:
  struct Start {
    bool is_live = false;
    int session_begin = 0;  // files: first image of this session
    int last_frame = -1;    // that is in the stream
    int64_t last_utime = -1;
  };
  // on_passed: called for each image of a file that is passed over, from the thread that reads; may be empty.
  using OnPassed = std::function<void(const SourceImage& image)>;
  ResumedImages(ImageStream* source, const Start& start, OnPassed on_passed = {})
      : source_(source), start_(start), on_passed_(std::move(on_passed)) {}

  std::optional<SourceImage> Next() override {
    while (auto image = source_->Next()) {
      if (start_.is_live) return Continued(std::move(*image));
      if (image->index > start_.last_frame && image->index >= start_.session_begin) return image;
      if (image->index >= start_.session_begin) ++num_passed_;
      if (on_passed_) on_passed_(*image);
    }
    return std::nullopt;
  }
  void Stop() override { source_->Stop(); }
  int64_t NumDropped() const override { return source_->NumDropped(); }
  // Images of this session that were passed over. Thread-safe.
  int NumPassed() const { return num_passed_; }

 private:
  SourceImage Continued(SourceImage image) {
    if (!is_shifted_) {
      is_shifted_ = true;
      index_shift_ = std::max(0, start_.last_frame + 1 - image.index);
      utime_shift_ = std::max<int64_t>(0, start_.last_utime + 1 - image.utime);
    }
    image.index += index_shift_;
    image.utime += utime_shift_;
    return image;
  }

  ImageStream* source_;
  const Start start_;
  const OnPassed on_passed_;
  std::atomic<int> num_passed_{0};
  bool is_shifted_ = false;
  int index_shift_ = 0;
  int64_t utime_shift_ = 0;
};

}  // namespace mapmend
