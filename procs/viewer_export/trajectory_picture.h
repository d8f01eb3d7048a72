#pragma once

#include <optional>
#include <string>

#include "libs/geometry/alignment.h"
#include "libs/map_view/snapshot.h"

namespace mapmend {

struct TrajectoryPictureOptions {
  // Of this component; null without. If it could be aligned, the picture is in the frame of the ground truth (metres)
  // and drawn over it, otherwise in the root's frame and units, on the plane of the camera positions.
  const Evaluation* evaluation = nullptr;
  const Trajectory* ground_truth = nullptr;
  // Where the camera is now, in the frame of the component's root.
  std::optional<Eigen::Vector3d> here;
};

// One component from above as SVG: a colour for each submap, a cross where tracking was lost.
std::string MakeTrajectorySvg(const Snapshot& snapshot, int component, const TrajectoryPictureOptions& options);

}  // namespace mapmend
