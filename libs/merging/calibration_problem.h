#pragma once

#include <map>
#include <string>

#include "libs/base/range.h"
#include "libs/optim/calibration.h"
#include "libs/stream/revision.h"
#include "libs/stream/submap.h"

namespace mapmend {

struct CalibrationProblemOptions {
  // For each keyframe at least this many of its longest tracks take part; 0: all.
  int points_per_keyframe = 250;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("points_per_keyframe", points_per_keyframe, Range(0, 1e6), "points; 0: all");
  }
};

// The calibration problem of a finished, refined map's main component: its refined keyframes and points, and the
// features as they are in the images, which are undone from the ideal camera of the flight into its real one. Throws
// std::runtime_error with one line if the map is not refined, or holds flights of different cameras.
//   sessions  by id; all that the revision names
CalibrationProblem MakeCalibrationProblem(const std::map<std::string, Session>& sessions, const MapRevision& revision,
                                          const CalibrationProblemOptions& options = {});

}  // namespace mapmend
