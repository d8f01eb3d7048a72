#include "libs/capture/paced_images.h"

#include <chrono>

namespace mapmend {

PacedImages::PacedImages(ImageStream* source, double speed, int max_waiting)
    : queue_(static_cast<size_t>(max_waiting)) {
  thread_ = std::thread([this, source, speed] {
    try {
      Play(source, speed);
    } catch (...) {
      error_ = std::current_exception();
    }
    queue_.Close();
  });
}

PacedImages::~PacedImages() {
  Stop();
  thread_.join();
}

void PacedImages::Play(ImageStream* source, double speed) {
  std::optional<int64_t> first_utime;
  std::chrono::steady_clock::time_point start;
  while (auto image = source->Next()) {
    if (!first_utime) {
      first_utime = image->utime;
      start = std::chrono::steady_clock::now();
    }
    const std::chrono::duration<double, std::micro> due(static_cast<double>(image->utime - *first_utime) / speed);
    std::unique_lock lock(mutex_);
    changed_.wait_until(lock, start + std::chrono::duration_cast<std::chrono::steady_clock::duration>(due),
                        [this] { return stop_; });
    if (stop_) return;
    queue_.Push(std::move(*image));
  }
}

std::optional<SourceImage> PacedImages::Next() {
  auto image = queue_.Pop();
  if (!image && error_) std::rethrow_exception(error_);
  return image;
}

void PacedImages::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  queue_.Clear();
}

}  // namespace mapmend
