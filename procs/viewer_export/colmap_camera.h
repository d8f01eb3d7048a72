#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libs/geometry/camera.h"

namespace mapmend {

// A camera in the terms of COLMAP (src/colmap/sensor/models.h of its sources lists them). Principal points are those of
// mapmend plus a half.
struct ColmapCamera {
  std::string model;  // "PINHOLE", "OPENCV", ...
  int model_id = -1;
  int width = 0, height = 0;
  std::vector<double> params;
  bool operator==(const ColmapCamera&) const = default;
};

// nullopt if COLMAP has no model that is the same: then images are to be undistorted.
std::optional<ColmapCamera> ToColmapCamera(const Camera& camera);
// PINHOLE.
ColmapCamera ToColmapCamera(const Pinhole& pinhole);

}  // namespace mapmend
