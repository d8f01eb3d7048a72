#pragma once

#include <cstdint>
#include <string>

#include "libs/bus/health.h"
#include "libs/wire/stream_sender.h"
#include "procs/frontend/run_options.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

// Where a frontend goes on whose predecessor died in the middle of a session. The default: at the beginning.
struct ResumePoint {
  bool is_resumed = false;
  bool ended = false;  // the session is complete: nothing is left to do
  IdSource ids;        // the next to be given out
  int open_submap = -1;
  int last_frame = -1;      // that is in the stream
  int64_t last_utime = -1;  // of it
};

// If the outbox tells that the session was begun before, or options say that it may have been: delivers what waits
// there, asks the store how far the session came, and lets the sender's numbers go on from there. Waits for the store
// as long as it takes: without its answer ids would be used twice. Throws std::runtime_error if a signal asks to stop
// meanwhile.
ResumePoint FindResumePoint(const RunOptions& options, const std::string& session, StreamSender* sender,
                            HealthReporter* health);

// Ends the submap that the predecessor left open.
void EndOpenSubmap(const ResumePoint& point, StreamSender* sender);

}  // namespace mapmend
