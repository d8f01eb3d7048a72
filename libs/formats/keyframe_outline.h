#pragma once

#include <array>

#include "libs/formats/placed_map.h"

namespace mapmend {

// How deep outlines of keyframes are drawn so that they can be told apart: half the median way from one to the next;
// 1 with fewer than two.
double OutlineDepth(const PlacedMap& map);

// The pyramid that a keyframe sees down to a depth, as the ends of eight lines.
std::array<Eigen::Vector3d, 16> KeyframeOutline(const PlacedMap& map, const PlacedPose& keyframe, double depth);

}  // namespace mapmend
