#pragma once

#include <algorithm>

namespace mapmend {

// Seconds of work that will be left for the merger when the last frame has been tracked: all submaps are compared again
// and the whole map is refined. 20 to 50 ms of CPU a keyframe on a 2.6 GHz core, measured on flights of 40 to 160
// keyframes.
//   num_keyframes  so far
//   done_share     of the flight, 0 to 1; 0: unknown
inline double EstimateMergingSeconds(double num_keyframes, double done_share) {
  constexpr double kSecondsPerKeyframe = 0.03;
  if (done_share < 0.05) return 0;  // too early to tell
  return kSecondsPerKeyframe * num_keyframes / std::min(1.0, done_share);
}

}  // namespace mapmend
