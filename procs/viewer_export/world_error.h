#pragma once

#include <optional>
#include <string>

#include "libs/map_view/world.h"
#include "procs/viewer_export/map_evaluation.h"

namespace mapmend {

// Against a ground truth in east, north, up from a known point, nothing aligned. Heights: up to a common difference,
// because barometers count from anywhere.
struct WorldError {
  size_t num_pairs = 0;
  double rmse_horizontal_m = 0, median_horizontal_m = 0, max_horizontal_m = 0;
  double mean_east_m = 0, mean_north_m = 0, mean_up_m = 0;  // estimate minus truth; up: median
  double rmse_vertical_m = 0;                               // after mean_up_m is taken out
};
//   trajectory  in the frame of `world`
//   origin      of the ground truth; nullopt: that of `world`
WorldError MeasureWorldError(const Trajectory& trajectory, const LocalFrame& world, const GroundTruth& ground_truth,
                             const std::optional<Geodetic>& origin);

// "positions.csv": each fix with the place that it has in the map, and what it is off.
std::string MakePositionsCsv(const Snapshot& snapshot, const WorldPlacement& world);

}  // namespace mapmend
