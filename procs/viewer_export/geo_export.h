#pragma once

#include <string>

#include "libs/map_view/world.h"

namespace mapmend {

// What of a map lies on the earth, for maps and geographic information systems: a feature for each piece of the path,
// each loss of tracking, each submap's outline and each keyframe's footprint. The snapshot's placed components must
// have been taken to east, north, up (PlaceOnEarth, "enu").

// RFC 7946: longitude, latitude (WGS 84), altitude as the receiver counts.
std::string MakePathGeoJson(const Snapshot& snapshot, const WorldPlacement& world);
// KML 2.3, heights as the receiver tells them, drawn on the ground.
//   more  folders to stand beside its own
std::string MakeMapKml(const Snapshot& snapshot, const WorldPlacement& world, const std::string& more);

}  // namespace mapmend
