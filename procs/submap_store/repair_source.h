#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libs/wire/codec.h"

namespace mapmend {

// Calls visit for every sound record in a file that may hold what a damaged database lacks: a recording of lcm-logger,
// an outbox, or another map database. Throws std::runtime_error with one line if it is none of these.
void ReadRepairSource(const std::string& path, const std::function<void(EncodedRecord)>& visit);

// The files of that kind, databases left aside, in a folder and in the folders in it.
std::vector<std::string> FindRepairSources(const std::string& folder);

bool IsDatabase(const std::string& path);

}  // namespace mapmend
