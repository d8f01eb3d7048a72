#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <string>

#include "libs/bus/bus.h"
#include "libs/wire/codec.h"

namespace mapmend {

// The sending end of the reliable stream for records that exist already (a recording): same window, acks, heartbeats
// and repetition as a frontend's, but the numbers are the records' own. One thread: the caller runs the bus's Handle.
class RecordSender {
 public:
  explicit RecordSender(Bus* bus);  // subscribes to the acks

  // True if the window has room.
  bool CanSend() const { return num_pending_ < kWindow; }
  // Records of a session must come in seq order from 0 on.
  void Send(EncodedRecord record);
  // Repeats what is overdue, sends heartbeats. Call at least twenty times a second.
  void Tick();
  bool AllAcknowledged() const { return num_pending_ == 0; }
  const std::string& StoreError() const { return store_error_; }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr int kWindow = 64;

  struct Pending {
    EncodedRecord record;
    Clock::time_point sent;
    int num_sent = 1;
  };
  struct Session {
    std::deque<Pending> pending;  // in seq order
    int64_t last = -1;
  };

  void Publish(const EncodedRecord& record);

  Bus* bus_;
  std::map<std::string, Session> sessions_;
  int num_pending_ = 0;
  Clock::time_point last_heartbeat_;
  std::string store_error_;
  Subscription acks_;
};

}  // namespace mapmend
