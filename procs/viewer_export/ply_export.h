#pragma once

#include <string>

#include "libs/map_view/snapshot.h"

namespace mapmend {

// A component as binary little-endian PLY point clouds, which CloudCompare and MeshLab open: coloured vertices only, no
// other elements, because that is what every reader agrees on. Points and path are two files, so that they can be told
// apart. Unit and frame: those of the component's root.

// The map points with their colours.
std::string MakePly(const Snapshot& snapshot, int component);
// The camera path as points along it, in its submap's colour.
std::string MakeCamerasPly(const Snapshot& snapshot, int component);

}  // namespace mapmend
