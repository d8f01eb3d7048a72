#pragma once

#include <array>
#include <cstdint>

namespace mapmend {

// The 256 learned point pairs of oriented BRIEF, x1 y1 x2 y2 each, relative to the keypoint; bit i of the descriptor is
// value(x1, y1) < value(x2, y2) of pair i. Rublee et al., ORB, ICCV 2011; the numbers are those of OpenCV's ORB (see
// THIRD_PARTY.md), so that descriptors fit the vocabularies trained for it.
extern const std::array<int8_t, 1024> kOrbPattern;

}  // namespace mapmend
