#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "libs/bus/hub_subscriptions.h"

namespace mapmend {

// Bytes that the hub holds for all clients together: what came of messages that are not complete, and what waits to be
// sent (once, however many it is sent to).
struct HubMemory {
  int64_t bytes = 0;
};

// One message as it goes over the wire, shared by all clients that it is sent to.
class HubFrame {
 public:
  HubFrame(std::vector<uint8_t> bytes, bool best_effort, HubMemory* memory);
  ~HubFrame();
  HubFrame(const HubFrame&) = delete;
  HubFrame& operator=(const HubFrame&) = delete;

  const std::vector<uint8_t>& bytes() const { return bytes_; }
  bool best_effort() const { return best_effort_; }
  // What it takes in memory: a flood of empty messages is a flood too.
  int64_t cost() const { return static_cast<int64_t>(bytes_.capacity()) + 128; }

 private:
  std::vector<uint8_t> bytes_;
  bool best_effort_;
  HubMemory* memory_;
};

// What the hub does with what a client says. Neither may delete the client.
class HubClient;
struct HubHandlers {
  // wire: the whole message as it came, to be passed on as it is. False: the client has to go.
  std::function<bool(HubClient*, std::string_view channel, std::string_view data, std::string_view wire)> publish;
  // Empty, or why the client has to go.
  std::function<std::string(HubClient*, std::string_view pattern)> subscribe;
  std::function<void(HubClient*, std::string_view pattern)> unsubscribe;
};

// The hub's end of one connection: parses what the client sends and holds what is to be sent to it. Wire format, all
// numbers 32 bits, big-endian: a greeting (magic, version) each way; then PUBLISH (1): channel length, channel, data
// length, data, in both directions; SUBSCRIBE (2) and UNSUBSCRIBE (3): length and a regular expression, from the
// client.
class HubClient {
 public:
  using Clock = std::chrono::steady_clock;

  // address: IPv4, host byte order.
  HubClient(int fd, uint32_t address, int64_t max_message_bytes, HubMemory* memory);
  ~HubClient();
  HubClient(const HubClient&) = delete;
  HubClient& operator=(const HubClient&) = delete;

  // Reads what is there (a bounded amount) and handles what is complete, for a few milliseconds at most: others wait.
  // False: the connection is over.
  bool Read(const HubHandlers& handlers);
  // Sends as much as the socket takes. False: the connection is over.
  bool Write();
  void Enqueue(std::shared_ptr<const HubFrame> frame);
  // If more than limit bytes of best-effort messages wait, drops the oldest. Returns how many were dropped.
  int DropOldestBestEffort(int64_t limit);
  // Whether the other end has something to acknowledge and has been silent for longer than timeout, though it would
  // take more. (The kernel's own time-out would also end those who are only slow to read.)
  bool IsSilent(std::chrono::milliseconds timeout) const;

  int fd() const { return fd_; }
  uint32_t address() const { return address_; }
  bool is_local() const { return address_ >> 24 == 127; }
  bool greeted() const { return greeted_; }
  bool has_output() const { return !queue_.empty(); }
  bool has_backlog() const { return has_backlog_; }  // complete messages may wait to be handled
  bool has_part() const { return !input_.empty(); }  // a message that is not complete
  int64_t reliable_bytes() const { return reliable_bytes_; }
  int64_t best_effort_bytes() const { return best_effort_bytes_; }
  int64_t held_bytes() const;
  const std::string& fault() const { return fault_; }  // why it has to go, if it is to blame
  void SetFault(const std::string& fault) { fault_ = fault; }

  HubSubscriptions subscriptions;
  const Clock::time_point accepted;
  Clock::time_point last_read;          // when something came
  Clock::time_point last_write;         // when it last took something, or had nothing to take
  bool paused = false;                  // not read from: it publishes to a subscriber whose queue is full
  bool stalled = false;                 // misses reliable messages until its queue has drained
  Clock::time_point no_patience_until;  // until then nobody waits for it
  bool trusted = false;                 // may publish
  int num_wrong_tokens = 0;
  bool told_of_no_token = false;
  bool has_acted = false;  // subscribed or published
  uint32_t events = 0;     // what epoll watches for

 private:
  // Handles what is complete and returns how many bytes are done with; sets fault_ or has_backlog_.
  size_t Parse(const uint8_t* data, size_t size, const HubHandlers& handlers);
  size_t Refuse(const std::string& fault);
  void KeepRest(const uint8_t* data, size_t size);

  const int fd_;
  const uint32_t address_;
  const int64_t max_message_bytes_;
  HubMemory* const memory_;
  std::vector<uint8_t> input_;  // what came and is not done with
  size_t expected_ = 0;         // how long the message at the front of it will be, if known
  bool greeted_ = false, has_backlog_ = false;
  std::string fault_;
  std::deque<std::shared_ptr<const HubFrame>> queue_;
  size_t sent_of_front_ = 0;
  int64_t reliable_bytes_ = 0, best_effort_bytes_ = 0;
};

// As numbers with dots.
std::string AddressText(uint32_t address);

}  // namespace mapmend
