#pragma once

#include "libs/mapping/connected_frames.h"
#include "procs/merger/cycle_consistency.h"

namespace mapmend {

struct LoopJudgement {
  double displacement = 0;  // median, of the common points, viewing distances
  double allowed = 0;
  bool plausible = true;
};

// A loop within a submap closes a cycle with the submap itself: its transform should be the identity, but for what has drifted on
// the way from one keyframe to the other. Ground that only looks the same displaces the common points by far more than that. The
// tolerances are those of cycles between submaps, less the edges' own uncertainty.
//   loop  verified connected frames of this submap with itself
LoopJudgement JudgeLoop(const Submap& submap, const ConnectedFrames& loop, const CycleConsistencyOptions& options);

}  // namespace mapmend
