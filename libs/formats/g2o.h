#pragma once

#include <string>

#include "libs/formats/placed_map.h"

namespace mapmend {

// The pose graph as a text of g2o (R. Kuemmerle et al., ICRA 2011), which GTSAM and Ceres' example read as well:
//   VERTEX_SE3:QUAT  keyframes, world_from_camera; their numbers are those of keyframes.tum, from 0 on
//   FIX              the first one
//   EDGE_SE3:QUAT    relations as they were measured, a_from_b, with information
// The edges' lengths are in the unit of the map: scales have been taken out, since SE(3) has none. The information is
// diagonal; g2o's error of a rotation is the vector part of its quaternion, half the angle, hence 4 / sigma^2. Comments
// begin the parts: tracked, tree, connections that are not in the tree, loops.
std::string PoseGraphG2o(const PlacedMap& map);

}  // namespace mapmend
