#pragma once

#include <functional>
#include <string>
#include <vector>

#include "procs/mapmend/child_process.h"

// Programs that do one thing and end. One that is killed is run again, up to ten times: what it does must bear being
// begun anew.
namespace mapmend {

// Runs one of mapmend's programs (argv[0] is its name) to its end, its output behind what the file log holds; what one
// that was killed has said is taken off again. While it runs, each_poll is called many times a second; the program is
// killed if that throws.
ExitStatus RunToEnd(
    const std::vector<std::string>& argv, const std::string& log, const std::function<void()>& each_poll = [] {});

// The same for one that must not fail: throws std::runtime_error, failed followed by the program's error line, if it
// does.
void RunTool(const std::vector<std::string>& argv, const std::string& log, const std::string& failed);

// Why a program has failed, in a line.  from: where its output begins in the log, bytes
std::string DescribeFailure(const std::string& program, const ExitStatus& status, const std::string& log, long from);

}  // namespace mapmend
