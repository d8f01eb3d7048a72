#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

namespace mapmend {

// Requests that wait to be answered, in the order in which they came. A repetition of one that waits, or that was
// answered within the last kRecentMs, is dropped: whoever repeats has not waited long enough. One thread; times are
// milliseconds of a steady clock.
class RequestQueue {
 public:
  static constexpr int64_t kRecentMs = 400;  // less than requesters wait before they repeat for the first time
  struct Key {
    std::string channel, requester;
    int64_t id = 0;
    auto operator<=>(const Key&) const = default;
  };
  // answer: sends the reply and returns its size, bytes.
  void Add(Key key, int64_t now_ms, std::function<int64_t()> answer) {
    Forget(now_ms);
    if (waiting_keys_.size() >= kMaxWaiting || answered_.contains(key) || !waiting_keys_.insert(key).second) {
      ++num_shed_;
      return;
    }
    waiting_.push_back({std::move(key), std::move(answer)});
  }
  // Answers until max_bytes have been sent.
  void Answer(int64_t now_ms, int64_t max_bytes) {
    for (int64_t bytes = 0; !waiting_.empty() && bytes < max_bytes;) {
      const auto [key, answer] = std::move(waiting_.front());
      waiting_.pop_front();
      waiting_keys_.erase(key);
      bytes += answer();
      answered_[key] = now_ms;
      by_time_.emplace_back(now_ms, key);
    }
  }
  bool Empty() const { return waiting_.empty(); }
  int64_t NumShed() const { return num_shed_; }

 private:
  static constexpr size_t kMaxWaiting = 1024;  // more requesters than there can be: somebody floods

  void Forget(int64_t now_ms) {
    while (!by_time_.empty() && now_ms - by_time_.front().first > kRecentMs) {
      answered_.erase(by_time_.front().second);
      by_time_.pop_front();
    }
  }

  std::deque<std::pair<Key, std::function<int64_t()>>> waiting_;
  std::set<Key> waiting_keys_;
  std::map<Key, int64_t> answered_;
  std::deque<std::pair<int64_t, Key>> by_time_;
  int64_t num_shed_ = 0;
};

}  // namespace mapmend
