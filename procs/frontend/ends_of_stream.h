#pragma once

#include <chrono>

namespace mapmend {

// Whether a camera on a bus has ended its stream. Anybody can send anything there, and a driver that cannot take an
// image may well send an empty one: the end counts if it is said three times within a second, and no good image comes
// in the second after that.
class EndsOfStream {
 public:
  using Time = std::chrono::steady_clock::time_point;

  void Said(Time now) {
    if (count_ == 0 || now - first_ > kSecond) {
      first_ = now;
      count_ = 0;
    }
    if (++count_ >= kTimes) last_ = now;
  }
  void GoodImage() { count_ = 0; }
  bool HasEnded(Time now) const { return count_ >= kTimes && now - last_ > kSecond; }

 private:
  static constexpr std::chrono::seconds kSecond{1};
  static constexpr int kTimes = 3;
  Time first_, last_;
  int count_ = 0;
};

}  // namespace mapmend
