#pragma once

#include <string>
#include <vector>

#include "procs/mapmend/run_options.h"

namespace mapmend {

// The frontend's command line for a flight. The bus is not in it.
std::vector<std::string> FrontendArguments(const RunOptions& options, const std::string& session);

// Where the frontend writes its times with --profile.
std::string ProfilePath(const RunOptions& options);

// The events of the flight, a JSON line each.
std::string EventsPath(const RunOptions& options);

}  // namespace mapmend
