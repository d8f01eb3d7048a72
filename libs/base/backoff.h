#pragma once

#include <algorithm>
#include <chrono>
#include <random>

namespace mapmend {

// How long to wait before something is tried again: twice as long each time up to a limit, give or take a quarter, so
// that those who wait for the same thing do not all come back at once. Only waiting depends on it, never a result.
class Backoff {
 public:
  Backoff(std::chrono::milliseconds first, std::chrono::milliseconds most) : first_(first), most_(most), next_(first) {}

  std::chrono::milliseconds Next() {
    const double factor = std::uniform_real_distribution<double>(0.75, 1.25)(Random());
    const auto wait = std::chrono::milliseconds(static_cast<int64_t>(static_cast<double>(next_.count()) * factor));
    next_ = std::min(most_, 2 * next_);
    return wait;
  }
  void Reset() { next_ = first_; }

 private:
  static std::mt19937& Random() {
    thread_local std::mt19937 random(std::random_device{}());
    return random;
  }
  std::chrono::milliseconds first_, most_, next_;
};

}  // namespace mapmend
