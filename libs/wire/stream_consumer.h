#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/stream/records.h"
#include "libs/wire/store_client.h"

namespace mapmend {

// Delivers every committed record of every session once, in seq order within a session, sessions oldest first: live
// from the bus when it arrives in order, fetched from the store otherwise. Sessions already in the store are delivered
// from seq 0 on start, so a restarted consumer rebuilds its state. A record is delivered only after the store has
// committed it (its ack was seen or it was fetched), so that downstream never knows more than what survives a crash.
class StreamConsumer {
 public:
  using Handler = std::function<void(const Record&)>;
  StreamConsumer(Bus* bus, StoreClient* store, Handler handler);
  ~StreamConsumer();

  // Throws std::runtime_error with one line if a session that had ended goes on after all (the store has taken it up
  // again): a consumer that starts afresh gets it whole.
  // Call in the process's loop: dispatches the bus for up to timeout_ms, then delivers what is due (at most
  // max_records, so that heartbeats go on). Returns the number of records delivered.
  int Spin(int timeout_ms, int max_records = 16);

  struct Cursor {
    std::string session;
    int64_t seq = -1;    // last delivered
    bool ended = false;  // the session's last record was delivered
  };
  std::vector<Cursor> Cursors() const;
  int QueueDepth() const;
  int64_t NumRefused() const;  // records that did not decode or validate

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend
