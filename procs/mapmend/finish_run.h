#pragma once

#include <string>
#include <vector>

#include "procs/mapmend/run_summary.h"

namespace mapmend {

// Runs one of mapmend's programs (argv[0] is its name) to its end, its output into the file log. Throws
// std::runtime_error, failed followed by the program's error line, if it fails.
void RunTool(const std::vector<std::string>& argv, const std::string& log, const std::string& failed);

// After every process has stopped: removes the frontend's outbox, completes summary.json, has the viewer build
// report.html again. Returns the lines to print: the summary table and where things are. Throws std::runtime_error with
// one line.
//   db  the database if it lies elsewhere than in OUT
std::string FinishRun(const std::string& out, const LauncherFigures& figures, const std::string& db = "");

}  // namespace mapmend
