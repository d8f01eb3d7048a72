#pragma once

#include <string>

#include "procs/mapmend/run_summary.h"

namespace mapmend {

// After every process has stopped: removes the frontend's outbox, completes summary.json, has the viewer build
// report.html again. Returns the lines to print: the summary table and where things are. Throws std::runtime_error with
// one line.
std::string FinishRun(const std::string& out, const LauncherFigures& figures);

}  // namespace mapmend
