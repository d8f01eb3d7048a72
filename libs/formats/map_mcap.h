#pragma once

#include <ostream>

#include "libs/formats/placed_map.h"

namespace mapmend {

// The map as an MCAP file for Foxglove and whoever else reads it. Messages are JSON in Foxglove's schemas:
//   /map/points     PointCloud         at the beginning: all points with their colours
//   /map/path       PosesInFrame       at the beginning: all frames' poses
//   /map/graph      SceneUpdate        at the beginning: keyframes, path, tree, other connections and loops as lines
//   /map/camera     PoseInFrame        each frame
//   /tf             FrameTransform     each frame: from the map to "camera"
//   /camera/info    CameraCalibration  each frame: of the ideal camera, so that what it sees is drawn
//   /log            Log                the frame of reference; losses, when they happened
// Times are those of the images. Coordinates are relative to the frame's origin; the frame is called as the map's.
void WriteMcap(const PlacedMap& map, std::ostream* stream);

}  // namespace mapmend
