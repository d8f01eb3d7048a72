#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libs/positioning/placement.h"
#include "procs/viewer_export/map_evaluation.h"
#include "procs/viewer_export/snapshot.h"

namespace mapmend {

// The positions that the sessions of a map tell, in the order of Snapshot::model, by time.
std::vector<SessionFixes> PositionsOf(const Snapshot& snapshot);

// Where the components of a map lie on the earth; nullopt if no session tells a position.
std::optional<WorldPlacement> PlaceOnEarth(const Snapshot& snapshot, const PlacementOptions& options);

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

// Takes every component that has its place to a frame on the earth (PlaceInFrame): "enu", east, north, up from the
// origin, or "utm", on the grid of the zone that holds it. The grid is taken as straight there: a kilometre away that
// is less than a centimetre; heights are stretched with it, by 0.04 % at most.
void PlaceOnEarth(const WorldPlacement& world, const std::string& frame, Snapshot* snapshot);

// "positions.csv": each fix with the place that it has in the map, and what it is off.
std::string MakePositionsCsv(const Snapshot& snapshot, const WorldPlacement& world);

}  // namespace mapmend
