#pragma once

#include <string>

#include "libs/geometry/alignment.h"
#include "procs/viewer_export/snapshot.h"

namespace mapmend {

// One component from above as SVG: a colour for each submap, a cross where tracking was lost.
//   evaluation, ground_truth  of this component; null without. If it could be aligned, the picture is in the frame of
//   the ground
//                             truth (metres) and drawn over it, otherwise in the root's frame and units, on the plane
//                             of the camera positions.
std::string MakeTrajectorySvg(const Snapshot& snapshot, int component, const Evaluation* evaluation,
                              const Trajectory* ground_truth);

}  // namespace mapmend
