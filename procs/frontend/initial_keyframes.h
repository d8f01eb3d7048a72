#pragma once

#include "procs/frontend/initialization.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

struct InitialKeyframes {
  int first = -1, second = -1;  // of the map; the frames in between have the indices in between
};

// The views of a beginning as keyframes of an empty map, ascending in time, with their points.
InitialKeyframes AddInitialKeyframes(const Initialization& initialization, WorkingMap* map);

bool IsInitialView(const Initialization& initialization, const Frame& frame);

}  // namespace mapmend
