#pragma once

#include "libs/formats/placed_map.h"
#include "libs/map_view/snapshot.h"

namespace mapmend {

// A component in the frame that it was placed in, with everything that the formats of libs/formats tell.
PlacedMap MakePlacedMap(const Snapshot& snapshot, int component);

}  // namespace mapmend
