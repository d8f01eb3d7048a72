#pragma once

#include <memory>
#include <string>

#include "libs/bus/bus.h"
#include "libs/mapping/records.h"

namespace mapmend {

struct StreamSenderOptions {
  int window = 64;              // records sent and not yet acknowledged
  int resend_after_ms = 20;     // what the store says is missing, not sooner
  int resend_unasked_ms = 500;  // what it says nothing about; grows with repeated attempts
  int heartbeat_ms = 50;
  std::string outbox_path;  // file that holds what is not acknowledged; empty: memory only
};

// The frontend's end of the reliable stream: numbers records, keeps them until the store has committed them, sends
// again. Owns a thread that calls the bus's Handle, so it makes progress while the caller computes. Thread-safe.
class StreamSender {
 public:
  // If the outbox holds records of this session (its frontend was killed), numbering goes on after them and they are
  // sent. Throws std::runtime_error with one line if it holds another session's, or cannot be written.
  StreamSender(Bus* bus, const std::string& session, const StreamSenderOptions& options);
  ~StreamSender();

  // Assigns the next seq, writes the record to the outbox and queues it. Returns the seq. Does not wait for the store:
  // without a store or link it goes on buffering (to disk).
  int64_t Append(int64_t utime, RecordBody body);
  // Waits until all is acknowledged, or timeout_ms have passed without any progress. True if all is acknowledged.
  bool Flush(int timeout_ms);

  int64_t LastSeq() const;
  int64_t AcknowledgedSeq() const;  // cumulative, -1: none
  std::string StoreError() const;   // last error the store reported in its acks, e.g. "disk full"

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Sends what a killed frontend left in its outbox and waits until it is acknowledged, or timeout_ms have passed without
// any progress. True if nothing is left. Calls the bus's Handle from a thread of its own meanwhile.
bool DeliverOutbox(Bus* bus, const std::string& path, int timeout_ms);

}  // namespace mapmend
