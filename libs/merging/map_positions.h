#pragma once

#include <map>
#include <string>
#include <vector>

#include "libs/merging/merged_map.h"
#include "libs/optim/position_prior.h"
#include "libs/positioning/placement.h"

namespace mapmend {

struct MapPositionOptions {
  bool use = true;           // in the refinement, where there are positions
  double min_sigma_m = 0.3;  // horizontally; the residuals may say less, since the map has followed what drifts slowly
  int min_positions = 10;    // that fit
  PlacementOptions placement;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("use", use);
    v("min_sigma_m", min_sigma_m, MoreThan(0), "m");
    v("min_positions", min_positions, Range(3, 1e9), "positions");
    v("placement", placement);
  }
};

// By flight (SubmapView::flight).
using FlightPositions = std::map<std::string, std::vector<PositionFix>>;

struct MapPositions {
  std::vector<PositionPrior> priors;  // of the map's keyframes, root frame
  std::string told;                   // what was found, for a person
};

// Where the receivers say that the keyframes were, in the frame of the map as it is: it is placed on the earth first.
// None if that leaves a freedom open. A receiver's error stays the same for a while, so keyframes that follow each
// other quickly count less each.
MapPositions FindMapPositions(const MergedMap& map, const FlightPositions& flights, const MapPositionOptions& options);

}  // namespace mapmend
