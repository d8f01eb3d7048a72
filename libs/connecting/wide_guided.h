#pragma once

#include "libs/connecting/wide_registration.h"

namespace mapmend {

// Points of either side looked for in the frames of the other, where a transform puts them.
struct WideGuidedMatches {
  std::vector<WideTrackMatch> matches;  // each track in one at most, most votes first
  int num_expected = 0;                 // points that should be seen in some frame, both ways together
  int num_found = 0;                    // that were
};

WideGuidedMatches SearchGuided(const WideSide& a, const WideSide& b, const Similarity3& b_from_a,
                               const WideRegistrationOptions& options);

}  // namespace mapmend
