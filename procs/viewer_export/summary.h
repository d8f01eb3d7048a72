#pragma once

#include <string>

#include "libs/map_view/snapshot.h"
#include "procs/viewer_export/map_evaluation.h"

namespace mapmend {

// Members of summary.json that others make, as text; empty: it has none.
struct SummaryParts {
  std::string world;   // MakeWorldJson
  std::string gaps;    // MakeGapsJson
  std::string mosaic;  // ExportMosaic
};

// summary.json (docs/exports.md lists its keys). evaluation and ground_truth may be null together. The launcher adds
// wall_s, frontend and processes afterwards.
std::string MakeSummaryJson(const Snapshot& snapshot, const MapEvaluation* evaluation, const GroundTruth* ground_truth,
                            const SummaryParts& parts = {});

}  // namespace mapmend
