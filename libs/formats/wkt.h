#pragma once

#include <string>

namespace mapmend {

// Well-known text (OGC 01-009, as LAS wants it) of a coordinate reference system, by its EPSG code: 4326 and 4979 (WGS
// 84), 32601 to 32660 and 32701 to 32760 (WGS 84 / UTM). Throws std::runtime_error for others.
std::string WellKnownText(int epsg);

}  // namespace mapmend
