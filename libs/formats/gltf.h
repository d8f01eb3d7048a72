#pragma once

#include <string>

#include "libs/formats/placed_map.h"

namespace mapmend {

// The map as one binary glTF 2.0 file (Khronos): "points" with their colours, "camera path" and "keyframes" (outlines
// of what each sees) as lines in the colours of the submaps, "connections" as lines (the tree green, others grey, loops
// orange), and a glTF camera for each keyframe, named by session and frame. glTF has y up; the topmost node turns the
// map so. Coordinates are floats relative to the frame's origin; asset.extras says frame, unit and origin.
std::string MapGlb(const PlacedMap& map);

}  // namespace mapmend
