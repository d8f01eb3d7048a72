#pragma once

#include "libs/map_view/snapshot.h"
#include "libs/mosaic/ground_plane.h"

namespace mapmend {

// Of one component, whose x axis points to the right in the picture from above.
LevelFrame FindLevelFrame(int component, const Snapshot& snapshot);

// Puts a component into the frame "level", that of FindLevelFrame; the note says where up comes from. The unit stays
// that of the root.
void PlaceLevel(int component, Snapshot* snapshot);

}  // namespace mapmend
