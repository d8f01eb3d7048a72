#pragma once

#include <string>

#include "libs/formats/placed_map.h"

// Trajectories in the formats of data sets: world_from_camera of every frame that has a pose.
namespace mapmend {

// KITTI odometry (A. Geiger, P. Lenz, R. Urtasun, CVPR 2012): a matrix of 3 x 4 a line, row by row. The format has
// neither times nor frame numbers; they are in a file of their own, line by line (KittiTimes).
std::string KittiPoses(const PlacedMap& map);
// "time session frame" of each line of KittiPoses: seconds, index of the session, number of the frame.
std::string KittiTimes(const PlacedMap& map);

// EuRoC MAV (M. Burri et al., IJRR 2016): csv with a head: time in ns, position, quaternion with w first. The columns
// of speed and biases, which a camera alone does not know, are left out.
std::string EurocCsv(const PlacedMap& map);

}  // namespace mapmend
