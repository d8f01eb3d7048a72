#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "procs/frontend/working_map.h"

namespace mapmend {

// Whether the camera can have been at a place at a time, seen from where it was before and afterwards: not if it would
// have flown several times as fast as it flies from keyframe to keyframe (median). Ground that looks the same elsewhere
// is told from what is there by nothing else. Yes where fewer than three keyframes tell the speed.
//   center      submap frame
//   max_factor  of the usual speed
bool IsWithinReach(const WorkingMap& map, int64_t utime, const Eigen::Vector3d& center, double max_factor);

}  // namespace mapmend
