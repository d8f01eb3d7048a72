#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

namespace mapmend {

// Between one who cannot wait (a camera) and one who may be busy: holds the newest few, drops the oldest, counts what
// it dropped. Thread-safe.
template <typename T>
class LatestQueue {
 public:
  explicit LatestQueue(size_t capacity) : capacity_(capacity) {}

  // Never waits. Without effect once closed.
  void Push(T value) {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    values_.push_back(std::move(value));
    if (values_.size() > capacity_) {
      values_.pop_front();
      ++num_dropped_;
    }
    changed_.notify_one();
  }
  // The oldest that is left. Waits while there is none; nullopt once closed and empty.
  std::optional<T> Pop() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !values_.empty() || closed_; });
    if (values_.empty()) return std::nullopt;
    T value = std::move(values_.front());
    values_.pop_front();
    return value;
  }
  // Nothing more comes; what waits can still be taken.
  void Close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }
  // Nothing more comes, nothing more is wanted.
  void Clear() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    values_.clear();
    changed_.notify_all();
  }
  int64_t NumDropped() const {
    const std::lock_guard lock(mutex_);
    return num_dropped_;
  }

 private:
  const size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<T> values_;
  int64_t num_dropped_ = 0;
  bool closed_ = false;
};

}  // namespace mapmend
