#pragma once

#include <array>
#include <optional>
#include <vector>

#include "libs/map_view/snapshot.h"

namespace mapmend {

// What a keyframe sees of the ground, in a world whose z axis points up.
struct Footprint {
  int submap = 0;  // index into Snapshot::submaps
  KeyframeId keyframe;
  int64_t utime = 0;
  Eigen::Vector3d camera = Eigen::Vector3d::Zero();
  std::array<Eigen::Vector3d, 4> corners;  // of the image: top left, top right, bottom right, bottom left

  Eigen::Vector3d Center() const { return (corners[0] + corners[1] + corners[2] + corners[3]) / 4; }
  // Along the image's columns (of an upright camera: along the flight) and rows.
  double Length() const;
  double Width() const;
  double Area() const;
};

struct Ground {
  Rigid3 level_from_world;            // z is up there
  std::vector<Footprint> footprints;  // ascending by time; level frame
  double height = 0;                  // median of cameras above the ground
};

// The footprints of a component's keyframes on the height of the points that each sees. Corners beyond the horizon, or
// further than five times the height, are brought nearer.
//   is_level  z is up in the component's world; else it is put into the frame "level" (level_frame.h)
// nullopt if the cameras are not above the ground, or most points far from it (indoors, say).
std::optional<Ground> FindGround(const Snapshot& snapshot, int component, bool is_level);

}  // namespace mapmend
