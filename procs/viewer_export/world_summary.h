#pragma once

#include <optional>
#include <string>

#include "libs/map_view/world.h"
#include "procs/viewer_export/map_evaluation.h"

namespace mapmend {

struct WorldSummaryOptions {
  const GroundTruth* ground_truth = nullptr;  // null without
  std::optional<Geodetic> ground_truth_origin;
};

// The member "world" of summary.json (docs/exports.md) as text.
//   placed  the snapshot after PlaceOnEarth
std::string MakeWorldJson(const Snapshot& placed, const WorldPlacement& world, const WorldSummaryOptions& options);

}  // namespace mapmend
