#pragma once

#include <cstdint>
#include <mutex>
#include <string>

namespace mapmend {

// What went wrong with a live source: images that were no good, and news that a person should hear of at once (the
// camera is gone, its clock was set, another one sends, too). Thread-safe.
class Problems {
 public:
  // An image that was no good. Returns how many there are now.
  int64_t Add(const std::string& what) {
    const std::lock_guard lock(mutex_);
    last_ = what;
    return ++count_;
  }
  // Of an image about which nothing is decided yet.
  void Suspect(const std::string& what) {
    const std::lock_guard lock(mutex_);
    last_ = what;
  }
  void Tell(const std::string& news) {
    const std::lock_guard lock(mutex_);
    news_ = news;
    ++num_news_;
  }
  // The last news is no longer true.
  void Withdraw() {
    const std::lock_guard lock(mutex_);
    news_.clear();
  }
  int64_t Count() const {
    const std::lock_guard lock(mutex_);
    return count_;
  }
  int64_t NumNews() const {
    const std::lock_guard lock(mutex_);
    return num_news_;
  }
  std::string News() const {
    const std::lock_guard lock(mutex_);
    return news_;
  }
  // What was wrong with the last image.
  std::string Last() const {
    const std::lock_guard lock(mutex_);
    return last_;
  }

 private:
  mutable std::mutex mutex_;
  std::string last_, news_;
  int64_t count_ = 0, num_news_ = 0;
};

}  // namespace mapmend
