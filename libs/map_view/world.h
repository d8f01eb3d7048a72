#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libs/map_view/snapshot.h"
#include "libs/positioning/placement.h"

namespace mapmend {

// The positions that the sessions of a map tell, in the order of Snapshot::model, by time.
std::vector<SessionFixes> PositionsOf(const Snapshot& snapshot);

// Where the components of a map lie on the earth; nullopt if no session tells a position.
std::optional<WorldPlacement> PlaceOnEarth(const Snapshot& snapshot, const PlacementOptions& options);

// Takes every component that has its place to a frame on the earth (PlaceInFrame): "enu", east, north, up from the
// origin, or "utm", on the grid of the zone that holds it. The grid is taken as straight there: a kilometre away that
// is less than a centimetre; heights are stretched with it, by 0.04 % at most.
void PlaceOnEarth(const WorldPlacement& world, const std::string& frame, Snapshot* snapshot);

}  // namespace mapmend
