#pragma once

#include <functional>
#include <string>

#include "procs/mapmend/map_file.h"

namespace mapmend {

struct MapRescue {
  bool changed = false;    // the flights hold more than before
  bool is_merged = false;  // the merged map is final and made of all that there is
};

// What a power cut has left in a folder of results, put in order on its database itself: outboxes delivered, open
// sessions ended. tell gets a line for each. Without always, a map that is in order is only looked at, and is_merged is
// not found out. Throws std::runtime_error with one line, Interrupted.
MapRescue RescueMap(const MapFileOptions& options, bool always, const std::function<void(const std::string&)>& tell);

}  // namespace mapmend
