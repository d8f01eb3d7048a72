#pragma once

#include <string>

#include "procs/mapmend/backend.h"
#include "procs/mapmend/run_options.h"

namespace mapmend {

// Where a flight goes on that was cut off (run --continue).
struct FlightPart {
  std::string session;    // goes on if it is open; else a new one
  std::string continues;  // the session that was ended in between, if any
  int first_frame = 0;    // of a file, that is not in the map yet
};

// Looks in the store for the flight's last session: options.session, else the newest of the same input and vehicle. The
// outboxes must have been delivered. An open session goes on in a new submap; one that was ended meanwhile (recover,
// Ctrl-C) cannot, so a new session takes up the flight at the next frame. Nothing of the flight there: session is
// fresh_session. Throws std::runtime_error if the store does not answer.
FlightPart FindFlightPart(Backend* backend, const RunOptions& options, const std::string& fresh_session);

}  // namespace mapmend
