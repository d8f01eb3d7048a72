#pragma once

#include <algorithm>
#include <chrono>

namespace mapmend {

// Tells from pings whether the other end of a connection is alive. A ping goes out each second; a connection is dead if
// nothing at all has come since a ping was sent for base_ms, or eight times what pings usually take, whichever is
// longer (a slow or lossy link is not a dead one), but at most max_ms. Pure: the caller brings the time.
class Liveness {
 public:
  using Clock = std::chrono::steady_clock;
  explicit Liveness(int base_ms = 3500, int max_ms = 20000) : base_ms_(base_ms), max_ms_(max_ms) {}

  bool PingIsDue(Clock::time_point now) const {
    return !waits_ && now - ping_sent_ >= std::chrono::milliseconds(kPingIntervalMs);
  }
  void OnPingSent(Clock::time_point now) {
    waits_ = true;
    ping_sent_ = now;
    // Gone without the caller looking, e.g. while it was stopped, says nothing about the other end.
    last_sign_ = now;
  }
  void OnPong(Clock::time_point now) {
    if (!waits_) return;
    waits_ = false;
    const double took_ms = std::chrono::duration<double, std::milli>(now - ping_sent_).count();
    usual_ms_ = std::max(took_ms, 0.9 * usual_ms_ + 0.1 * took_ms);
  }
  // Anything has come, or nothing could because we did not look.
  void OnSign(Clock::time_point now) { last_sign_ = now; }

  bool IsDead(Clock::time_point now) const {
    return waits_ && now - last_sign_ >= std::chrono::milliseconds(DeadAfterMs());
  }
  int DeadAfterMs() const {
    return std::clamp(static_cast<int>(kTimesUsual * usual_ms_), base_ms_, std::max(base_ms_, max_ms_));
  }

 private:
  static constexpr int kPingIntervalMs = 1000;
  static constexpr double kTimesUsual = 8;

  int base_ms_, max_ms_;
  bool waits_ = false;
  double usual_ms_ = 0;
  Clock::time_point ping_sent_, last_sign_;
};

}  // namespace mapmend
