#pragma once

#include "libs/stream/submap.h"
#include "procs/submap_store/database.h"

namespace mapmend {

// One submap as it was after any record of its session: reads the records from the file, forwards as long as it is
// asked for later and later states, and from the submap's start again when asked for an earlier one.
class SubmapTracker {
 public:
  // start_seq: of the SubmapStarted record.
  SubmapTracker(Database* database, const SessionRow& session, SubmapId submap, int64_t start_seq);

  // The submap after record seq (>= start_seq). Valid until the next call.
  const Submap& AsOf(int64_t seq);

 private:
  Database* database_;
  SessionRow session_;
  SubmapId submap_;
  int64_t start_seq_, seq_;
  Session model_;
};

}  // namespace mapmend
