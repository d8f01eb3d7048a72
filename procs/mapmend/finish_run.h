#pragma once

#include <string>

#include "procs/mapmend/run_summary.h"

namespace mapmend {

// After every process has stopped: removes the frontend's outbox, completes summary.json, has the viewer build
// report.html again. Returns the lines to print: the summary table and where things are. Throws std::runtime_error with
// one line.
//   db  the database if it lies elsewhere than in OUT
std::string FinishRun(const std::string& out, const LauncherFigures& figures, const std::string& db = "");

}  // namespace mapmend
