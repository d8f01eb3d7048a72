#pragma once

#include "procs/mapmend/run_options.h"

namespace mapmend {

// Exit codes of `mapmend run` and `mapmend replay` besides 0 and 1 (an error; nothing was mapped, or not to the end).
inline constexpr int kExitInputCutShort = 3;  // not all of the input could be used; the rest is mapped
inline constexpr int kExitSmallMap = 4;       // mapped to the end, but the main map holds less than half of the flight
inline constexpr int kExitInterrupted = 130;  // Ctrl-C or SIGTERM; map.db holds what was mapped so far

// Maps one flight: prepares the folder, starts the processes, follows them, exports, prints the summary. Returns the
// exit code; throws std::runtime_error with one line for an error.
int RunFlight(const RunInputs& inputs);

}  // namespace mapmend
