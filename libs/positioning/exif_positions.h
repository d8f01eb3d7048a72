#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libs/positioning/position_fix.h"

namespace mapmend {

// Where a photo was taken, from its EXIF tags, and how the camera was held, from those that DJI cameras add in XMP. The
// time is not read: the photo's own counts. nullopt if it tells no position, or one that is no good.
std::optional<PositionFix> ReadExifPosition(const std::string& file);

// One for each photo; empty if none of the first 20 has one.
std::vector<std::optional<PositionFix>> ReadExifPositions(const std::vector<std::string>& files);

}  // namespace mapmend
