#pragma once

#include <string>

#include "procs/viewer_export/snapshot.h"

namespace mapmend {

// A component as a binary little-endian PLY point cloud, which CloudCompare and MeshLab open: the map points with their
// colours, then the camera path as points along it in its submap's colour. Coloured vertices only, no other elements,
// because that is what every reader agrees on. Unit and frame: those of the component's root.
std::string MakePly(const Snapshot& snapshot, int component);

}  // namespace mapmend
