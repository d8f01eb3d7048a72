#pragma once

#include "libs/geometry/rigid3.h"
#include "libs/geometry/similarity3.h"

// Transforms that are the same to the last bit, as what was written and read again must be. A rotation has two
// quaternions; they are not the same here.
namespace mapmend {

inline bool operator==(const Rigid3& l, const Rigid3& r) {
  return l.rotation.coeffs() == r.rotation.coeffs() && l.translation == r.translation;
}

inline bool operator==(const Similarity3& l, const Similarity3& r) {
  return l.scale == r.scale && l.rotation.coeffs() == r.rotation.coeffs() && l.translation == r.translation;
}

}  // namespace mapmend
