#pragma once

#include <mutex>
#include <string>
#include <vector>

namespace mapmend {

// Frames that could not be used, each with its reason. Thread-safe: one thread reads images, another reports.
class LeftOut {
 public:
  // what: a whole sentence about the frame, e.g. "f06.jpg is cut short".
  void Add(const std::string& what) {
    const std::lock_guard lock(mutex_);
    ++count_;
    if (sentences_.size() < kMaxKept) sentences_.push_back(what);
  }
  int Count() const {
    const std::lock_guard lock(mutex_);
    return count_;
  }
  // All of them (the first thousands of a flight that is worse than that).
  std::vector<std::string> Sentences() const {
    const std::lock_guard lock(mutex_);
    return sentences_;
  }

 private:
  static constexpr size_t kMaxKept = 10000;
  mutable std::mutex mutex_;
  std::vector<std::string> sentences_;
  int count_ = 0;
};

}  // namespace mapmend
