#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "libs/wire/codec.h"
#include "libs/wire/resend_timer.h"

namespace mapmend {

// The records of one session that are on their way, and when each is to be sent again. A record that the store says is
// missing is lost if the store has one that was sent after it (the bus keeps the order). If there is no progress for
// longer than acknowledgements take, the oldest is sent again, ever more rarely: when it comes, the rest is known to be
// lost, or follows. So a slow link is never filled with what is on its way already. Not thread-safe.
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
  // Another connection, or another store. What went to the old one may be lost, and says nothing about how long the new
  // one takes: what the store lacks of it is sent once more, when it says so.
  void OnNewPeer();
  // Calls send for each record that is due, oldest first, until it returns false.
  using Sending = std::function<bool(const EncodedRecord&)>;
  void SendDue(Clock::time_point now, const Sending& send);

 private:
  struct Entry {
    EncodedRecord record;
    Clock::time_point first_sent, last_sent;
    int64_t first_sending = 0, sending = 0;  // numbers of its first and last sending, in order over all records
    int num_attempts = 0;
    bool is_sent = false, is_timed = false;
    bool is_asked = false;        // the store said that it is missing
    bool is_lost = false;         // and has what was sent later, or has it not from the connection before
    bool is_of_old_peer = false;  // it was not sent since
  };
  bool Send(Entry* entry, Clock::time_point now, const Sending& send);

  std::chrono::milliseconds resend_unasked_;
  std::map<int64_t, Entry> entries_;  // by seq
  int64_t bytes_ = 0, num_sendings_ = 0;
  int64_t newest_come_ = -1;  // number of the newest sending that has certainly come
  Clock::time_point last_progress_;
  int backoff_ = 0;  // patience has run out so often in a row
  int burst_ = 1;    // records sent again when it does: more, while that is what makes progress
  ResendTimer timer_;
};

}  // namespace mapmend
