#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "libs/stream/submap.h"

namespace mapmend {

// The seed that a flight was mapped with, as its frontend tells in the settings of the session; of several flights that
// of the one that began last (ties: the greater name). So a map that is merged anew is the same as the run's. nullopt
// if the settings do not tell.
std::optional<uint64_t> SeedOfFlights(const std::map<std::string, Session>& sessions);

}  // namespace mapmend
