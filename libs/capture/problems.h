#pragma once

#include <cstdint>
#include <mutex>
#include <string>

namespace mapmend {

// What went wrong with a live source: a count, and the last one in words. Thread-safe.
class Problems {
 public:
  // Returns how many there are now.
  int64_t Add(const std::string& what) {
    const std::lock_guard lock(mutex_);
    last_ = what;
    return ++count_;
  }
  // Something to tell that costs no image; empty: it is over.
  void Tell(const std::string& what) {
    const std::lock_guard lock(mutex_);
    last_ = what;
  }
  int64_t Count() const {
    const std::lock_guard lock(mutex_);
    return count_;
  }
  std::string Last() const {
    const std::lock_guard lock(mutex_);
    return last_;
  }

 private:
  mutable std::mutex mutex_;
  std::string last_;
  int64_t count_ = 0;
};

}  // namespace mapmend
