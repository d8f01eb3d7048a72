#pragma once

#include <string>

#include "procs/viewer_export/snapshot.h"

namespace mapmend {

// A component as a COLMAP text model (Schönberger and Frahm, CVPR 2016; https://colmap.github.io/format.html): one
// PINHOLE camera for each session, the keyframes with their features, and the map points with their tracks. COLMAP puts
// the centre of the first pixel at (0.5, 0.5), mapmend at (0, 0): pixels are shifted by a half. The pictures are
// undistorted ones, named by session and frame ("0/frame_000123.png"); mapmend does not write them.
struct ColmapModel {
  std::string cameras, images, points;  // cameras.txt, images.txt, points3D.txt
};
ColmapModel MakeColmapModel(const Snapshot& snapshot, int component);

}  // namespace mapmend
