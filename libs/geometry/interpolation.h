#pragma once

#include "libs/geometry/rigid3.h"

namespace mapmend {

// A camera between two others, by the share of the way from the first to the second: its centre on the straight line,
// its attitude on the shortest turn. All are cam_from_world.
inline Rigid3 Between(const Rigid3& first, const Rigid3& second, double share) {
  const Rigid3 a = first.Inverse(), b = second.Inverse();
  return Rigid3(a.rotation.slerp(share, b.rotation), a.translation + share * (b.translation - a.translation)).Inverse();
}

}  // namespace mapmend
