#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "libs/base/range.h"
#include "libs/bus/bus.h"
#include "libs/stream/records.h"

namespace mapmend {

struct StreamSenderOptions {
  int window = 64;                       // records sent and not yet acknowledged, at most
  int64_t window_bytes = 2 << 20;        // of them, but one may be larger
  int resend_unasked_ms = 2000;          // the oldest of them, while the store says nothing
  int heartbeat_ms = 50;                 //
  int sync_ms = 500;                     // the disk is told to keep what was appended; a power cut takes no more
  int64_t max_queue_bytes = 256 << 20;   // waiting for a slow disk; beyond it the oldest are given up
  int64_t max_memory_bytes = 512 << 20;  // of the outbox while the disk is full
  std::string outbox_path;               // file that holds what is not acknowledged; empty: memory only

  // Not visited: outbox_path: of one flight.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("window", window, Range(1, 1e6), "records");
    v("window_bytes", window_bytes, Range(1, 1e12), "bytes");
    v("resend_unasked_ms", resend_unasked_ms, Range(1, 3.6e6), "ms");
    v("heartbeat_ms", heartbeat_ms, Range(1, 3.6e6), "ms");
    v("sync_ms", sync_ms, Range(0, 3.6e6), "ms");
    v("max_queue_bytes", max_queue_bytes, Range(1, 1e12), "bytes");
    v("max_memory_bytes", max_memory_bytes, Range(1, 1e12), "bytes");
  }
};

// The frontend's end of the reliable stream: numbers records, keeps them until the store has committed them, sends
// again. A thread of its own does all that may wait, for the disk or for the bus (whose Handle it calls), so the caller
// never does. Thread-safe.
class StreamSender {
 public:
  // If the outbox holds records of this session (its frontend was killed), numbering goes on after them and they are
  // sent. Throws std::runtime_error with one line if it holds another session's, or cannot be written.
  StreamSender(Bus* bus, const std::string& session, const StreamSenderOptions& options);
  // What was appended is in the outbox afterwards.
  ~StreamSender();

  // Assigns the next seq and queues the record. Returns the seq. Never waits.
  int64_t Append(int64_t utime, RecordBody body);
  // Waits until all is acknowledged, or timeout_ms have passed without any progress. True if all is acknowledged.
  bool Flush(int timeout_ms);

  // Numbering goes on after seq: what the store has, if the outbox no longer tells; -1: from the start. Only while
  // nothing waits to be acknowledged.
  void ContinueAfter(int64_t seq);

  int64_t LastSeq() const;
  int64_t AcknowledgedSeq() const;  // cumulative, -1: none
  std::string StoreError() const;   // last error the store reported in its acks, e.g. "disk full"
  // What stands between us and an acknowledgement, for a person: the store's refusal, no link, a silent store.
  std::string Obstacle() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Sends what a killed frontend left in its outbox and waits until it is acknowledged, or timeout_ms have passed without
// any progress. True if nothing is left. Calls the bus's Handle from a thread of its own meanwhile.
bool DeliverOutbox(Bus* bus, const std::string& path, int timeout_ms);

}  // namespace mapmend
