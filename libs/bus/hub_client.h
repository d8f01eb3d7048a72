#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <regex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace mapmend {

// One message as it goes over the wire, shared by all clients that it is sent to.
struct HubFrame {
  std::vector<uint8_t> bytes;
  bool best_effort = false;
};

// The hub's end of one connection: parses what the client sends and holds what is to be sent to it. Wire format, all
// numbers 32 bits, big-endian: a greeting (magic, version) each way; then PUBLISH (1): channel length, channel, data
// length, data, in both directions; SUBSCRIBE (2) and UNSUBSCRIBE (3): length and a regular expression, from the
// client.
class HubClient {
 public:
  HubClient(int fd, int64_t max_message_bytes);
  ~HubClient();
  HubClient(const HubClient&) = delete;
  HubClient& operator=(const HubClient&) = delete;

  // Reads what is there (a bounded amount) and calls publish for each complete message. False: the connection is over.
  bool Read(const std::function<void(std::string_view channel, std::shared_ptr<const HubFrame>)>& publish);
  // Sends as much as the socket takes. False: the connection is over.
  bool Write();
  bool Wants(const std::string& channel);
  void Enqueue(std::shared_ptr<const HubFrame> frame);
  // Drops the oldest best-effort messages until no more than limit bytes of them wait. Returns how many were dropped.
  int DropOldestBestEffort(int64_t limit);

  int fd() const { return fd_; }
  bool has_output() const { return !queue_.empty(); }
  int64_t reliable_bytes() const { return reliable_bytes_; }
  int64_t best_effort_bytes() const { return best_effort_bytes_; }
  bool misbehaved() const { return misbehaved_; }

  bool paused = false;                               // not read from: it publishes to a subscriber whose queue is full
  bool stalled = false;                              // misses reliable messages until its queue has drained
  std::chrono::steady_clock::time_point last_write;  // when it last took something, or had nothing to take
  uint32_t events = 0;                               // what epoll watches for

 private:
  bool Parse(const std::function<void(std::string_view, std::shared_ptr<const HubFrame>)>& publish);
  bool Refuse();

  int fd_;
  int64_t max_message_bytes_;
  std::vector<uint8_t> input_;
  size_t parsed_ = 0;  // bytes of input_ that are done with
  bool greeted_ = false, misbehaved_ = false;
  std::deque<std::shared_ptr<const HubFrame>> queue_;
  size_t sent_of_front_ = 0;
  int64_t reliable_bytes_ = 0, best_effort_bytes_ = 0;

  struct Pattern {
    std::string text;
    bool is_plain = true;
    std::regex regex;
  };
  std::vector<Pattern> patterns_;
  std::map<std::string, bool> wants_;  // cache of Wants
};

}  // namespace mapmend
