#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "libs/bus/codec.h"
#include "libs/bus/resend_timer.h"

namespace mapmend {

// The records of one session that are on their way, and when each is to be sent again. A record that the store says is
// missing is lost if the store has a later one that was sent after it (the bus keeps the order), or if it was sent
// longer ago than acknowledgements take. While the store says nothing, only the oldest is sent again now and then: the
// store asks for what it lacks as soon as it hears a heartbeat. Not thread-safe.
class SendWindow {
 public:
  using Clock = std::chrono::steady_clock;
  explicit SendWindow(int resend_unasked_ms) : resend_unasked_(resend_unasked_ms) {}

  bool Empty() const { return entries_.empty(); }
  int Size() const { return static_cast<int>(entries_.size()); }
  int64_t Bytes() const { return bytes_; }
  int64_t LastSeq() const { return entries_.rbegin()->first; }

  void Add(EncodedRecord record);
  void Acknowledge(int64_t cumulative, Clock::time_point now);
  // What the store says is missing; numbers that are not in the window do not matter.
  void OnMissing(const std::vector<int64_t>& missing);
  // What went over the old one may be lost, and says nothing about how long the new one takes: what the store lacks of
  // it is sent once more, when it says so.
  void OnNewConnection();
  // Calls send for each record that is due, oldest first, until it returns false.
  void SendDue(Clock::time_point now, const std::function<bool(const EncodedRecord&)>& send);

 private:
  struct Entry {
    EncodedRecord record;
    Clock::time_point first_sent, last_sent;
    int64_t sending = 0;  // number of its last sending, in order over all records
    bool is_sent = false, is_timed = false;
    bool is_asked = false;  // the store said that it is missing
    bool is_lost = false;   // and has what was sent later, or has it not from the connection before
    bool is_of_old_connection = false;
    int num_attempts = 0;  // over this connection
  };
  std::chrono::milliseconds Patience(const Entry& entry) const;

  std::chrono::milliseconds resend_unasked_;
  std::map<int64_t, Entry> entries_;  // by seq
  int64_t bytes_ = 0, num_sendings_ = 0;
  Clock::time_point last_progress_;  // when something was acknowledged
  ResendTimer timer_;
};

}  // namespace mapmend
