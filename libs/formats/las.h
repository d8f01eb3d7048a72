#pragma once

#include <string>

#include "libs/formats/placed_map.h"

namespace mapmend {

// The points as LAS 1.4 (ASPRS, revision 15) with point records of format 7: coordinates as 32-bit integers with scale
// and offset in the header, colours of 16 bits. The point source is the number of the submap, "user data" how many
// keyframes see the point, at most 255. With an EPSG code the reference system is there as WKT. LAS has no place for a
// unit that means nothing: the system identifier says it.
// Throws std::runtime_error if the EPSG code is not one of WellKnownText.
std::string PointsLas(const PlacedMap& map);

}  // namespace mapmend
