#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>

namespace mapmend {

// How long an acknowledgement usually takes, and hence from when on a record that the store says is missing is lost
// rather than still on its way: mean and mean deviation as TCP keeps them (RFC 6298). On a slow link most of the time
// is spent waiting behind our own records, so this also keeps us from sending what is already queued.
class ResendTimer {
 public:
  using Duration = std::chrono::steady_clock::duration;

  void OnAcknowledged(Duration took) {
    const double ms = std::chrono::duration<double, std::milli>(took).count();
    if (mean_ms_ < 0) {
      mean_ms_ = ms;
      deviation_ms_ = ms / 2;
      return;
    }
    deviation_ms_ += (std::abs(ms - mean_ms_) - deviation_ms_) / 4;
    mean_ms_ += (ms - mean_ms_) / 8;
  }
  void Reset() { mean_ms_ = -1; }

  std::chrono::milliseconds Timeout() const {
    constexpr double kUnknownMs = 300, kLeastMs = 20, kMostMs = 60000;
    const double ms = mean_ms_ < 0 ? kUnknownMs : std::clamp(mean_ms_ + 4 * deviation_ms_, kLeastMs, kMostMs);
    return std::chrono::milliseconds(static_cast<int64_t>(ms));
  }

 private:
  double mean_ms_ = -1, deviation_ms_ = 0;
};

}  // namespace mapmend
