#pragma once

#include <string>
#include <vector>

#include "libs/map_view/snapshot.h"
#include "libs/merging/restoration_log.h"

namespace mapmend {

// The merging process of a flight (the paper's section 3.6 and Table 1), from its records and the connections that are
// accepted now: when each submap began and was lost, and which frame found what had been lost. Submaps are named by
// their index in the snapshot.
struct RestorationTable {
  std::vector<RestorationStep> steps;
  // What RestorationStep::connections points into; they belong to the model.
  std::vector<const EvaluatedConnection*> connections;
};
RestorationTable MakeRestorationTable(const Snapshot& snapshot);

// The stacks as they are now: "L1 A, D-C-B; L2 G-E", with a dash for an empty one. Empty before the first submap.
std::string DescribeStacks(const Snapshot& snapshot);

}  // namespace mapmend
