#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

#include "libs/capture/image_stream.h"
#include "procs/frontend/frame_maker.h"
#include "procs/frontend/profiler.h"

namespace mapmend {

// Takes images and extracts their features in a thread of its own, a few frames ahead of tracking. From a stream that
// drops no images, the frames and their order do not depend on timing.
class FrameQueue {
 public:
  FrameQueue(ImageStream* source, const FrameMaker* maker, size_t ahead = 3) : source_(source), ahead_(ahead) {
    thread_ = std::thread([this, source, maker] { Produce(source, maker); });
  }
  ~FrameQueue() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    source_->Stop();
    changed_.notify_all();
    thread_.join();
  }

  // Waits up to timeout_ms for the next frame. Null if none has come, or none will (then HasEnded). Rethrows what
  // reading or extraction threw.
  FramePtr Next(int timeout_ms) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::milliseconds(timeout_ms),
                      [this] { return !frames_.empty() || produced_all_; });
    if (frames_.empty()) {
      has_ended_ = produced_all_;
      if (has_ended_ && error_) std::rethrow_exception(error_);
      return nullptr;
    }
    FramePtr frame = frames_.front();
    frames_.pop_front();
    changed_.notify_all();
    return frame;
  }
  bool HasEnded() const { return has_ended_; }

 private:
  static std::optional<SourceImage> Read(ImageStream* source) {
    const StageTimer timer("capture/read");
    return source->Next();
  }
  static FramePtr Make(const FrameMaker* maker, const SourceImage& image) {
    const StageTimer timer("capture/features");
    return maker->Make(image);
  }
  void Produce(ImageStream* source, const FrameMaker* maker) {
    try {
      while (const auto image = Read(source)) {
        FramePtr frame = Make(maker, *image);
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return frames_.size() < ahead_ || stop_; });
        if (stop_) break;
        frames_.push_back(std::move(frame));
        changed_.notify_all();
      }
    } catch (...) {
      error_ = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    produced_all_ = true;
    changed_.notify_all();
  }

  ImageStream* source_;
  size_t ahead_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<FramePtr> frames_;
  std::exception_ptr error_;
  bool produced_all_ = false, stop_ = false, has_ended_ = false;
  std::thread thread_;
};

}  // namespace mapmend
