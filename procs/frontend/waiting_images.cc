#include "procs/frontend/waiting_images.h"

#include <spdlog/spdlog.h>

#include <exception>

#include "procs/frontend/give_way.h"
#include "procs/frontend/image_spooler.h"

namespace mapmend {

WaitingImages::WaitingImages(const ImageOptions& options, int width, bool may_wait)
    : options_(options), width_(width), may_wait_(may_wait), thread_([this] { Run(); }) {}

WaitingImages::~WaitingImages() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void WaitingImages::Add(const FramePtr& frame) {
  const OriginalImage original = frame->original.Get();
  if (original.pixels == nullptr) return;  // small enough as it came
  const int64_t size = SizeOf(original), limit = int64_t{options_.max_waiting_mb} << 20;
  std::unique_lock lock(mutex_);
  if (may_wait_) changed_.wait(lock, [&] { return queue_.empty() || queue_bytes_ + size <= limit; });
  while (!queue_.empty() && queue_bytes_ + size > limit) {
    queue_bytes_ -= queue_.front().bytes;
    queue_.front().frame->original.LetGo();
    queue_.pop_front();
  }
  queue_bytes_ += size;
  queue_.push_back({frame, size});
  lock.unlock();
  changed_.notify_all();
}

void WaitingImages::Flush() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return queue_.empty() && !is_working_; });
}

void WaitingImages::Run() {
  GiveWayToTracking();
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return !queue_.empty() || stop_; });
    if (stop_) return;
    const Item item = queue_.front();
    queue_.pop_front();
    queue_bytes_ -= item.bytes;
    is_working_ = true;
    lock.unlock();
    Encode(*item.frame);
    lock.lock();
    is_working_ = false;
    changed_.notify_all();
  }
}

void WaitingImages::Encode(const Frame& frame) const {
  OriginalImage original = frame.original.Get();
  if (original.pixels == nullptr) return;  // let go of meanwhile
  try {
    original.encoded = std::make_shared<KeyframeImage>(EncodeImage(original, width_, options_.quality));
    original.pixels = nullptr;
    frame.original.Replace(std::move(original));
  } catch (const std::exception& e) {
    spdlog::debug("frontend: the image of frame {}: {}", frame.index, e.what());
  }
}

}  // namespace mapmend
