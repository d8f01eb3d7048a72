#pragma once

#include <algorithm>
#include <chrono>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace mapmend {

// How long it took from a keyframe's arrival on the bus until the transforms that it changed were broadcast.
class LatencyMeter {
 public:
  using Clock = std::chrono::steady_clock;

  // A keyframe record has been heard, though perhaps not delivered yet.
  void OnHeard(const std::string& session, int64_t seq) {
    heard_.try_emplace({session, seq}, Clock::now());
    constexpr size_t kMaxWaiting = 10000;
    if (heard_.size() > kMaxWaiting) heard_.erase(heard_.begin());
  }
  // The keyframe record is being worked on now.
  void OnDelivered(const std::string& session, int64_t seq) {
    const auto it = heard_.find({session, seq});
    current_ =
        it == heard_.end() ? Clock::time_point() : it->second;  // fetched from the store: it came in another life
    if (it != heard_.end()) heard_.erase(it);
  }
  void OnBroadcast() {
    if (current_ == Clock::time_point()) return;
    milliseconds_.push_back(std::chrono::duration<double, std::milli>(Clock::now() - current_).count());
    constexpr size_t kMaxKept = 10000;
    if (milliseconds_.size() > kMaxKept) milliseconds_.pop_front();
  }
  // Of the broadcasts so far; 0 without any.
  double Percentile(double fraction) const {
    if (milliseconds_.empty()) return 0;
    std::vector<double> sorted(milliseconds_.begin(), milliseconds_.end());
    const auto nth = sorted.begin() + static_cast<long>(fraction * static_cast<double>(sorted.size() - 1));
    std::nth_element(sorted.begin(), nth, sorted.end());
    return *nth;
  }
  size_t Count() const { return milliseconds_.size(); }

 private:
  std::map<std::pair<std::string, int64_t>, Clock::time_point> heard_;
  Clock::time_point current_;
  std::deque<double> milliseconds_;
};

}  // namespace mapmend
