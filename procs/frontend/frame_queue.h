#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

#include "procs/frontend/frame_maker.h"
#include "procs/frontend/image_source.h"
#include "procs/frontend/profiler.h"

namespace mapmend {

// Reads images and extracts their features in a thread of its own, a few frames ahead of tracking. The frames and their order
// do not depend on timing.
class FrameQueue {
 public:
  FrameQueue(ImageSource* source, const FrameMaker* maker, size_t ahead = 3) : ahead_(ahead) {
    thread_ = std::thread([this, source, maker] { Produce(source, maker); });
  }
  ~FrameQueue() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }

  // Null at the end. Rethrows what reading or extraction threw.
  FramePtr Next() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !frames_.empty() || ended_; });
    if (frames_.empty()) {
      if (error_) std::rethrow_exception(error_);
      return nullptr;
    }
    FramePtr frame = frames_.front();
    frames_.pop_front();
    changed_.notify_all();
    return frame;
  }

 private:
  static std::optional<SourceImage> Read(ImageSource* source) {
    const StageTimer timer("capture/read");
    return source->Next();
  }
  static FramePtr Make(const FrameMaker* maker, const SourceImage& image) {
    const StageTimer timer("capture/features");
    return maker->Make(image);
  }
  void Produce(ImageSource* source, const FrameMaker* maker) {
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
    ended_ = true;
    changed_.notify_all();
  }

  size_t ahead_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<FramePtr> frames_;
  std::exception_ptr error_;
  bool ended_ = false, stop_ = false;
  std::thread thread_;
};

}  // namespace mapmend
