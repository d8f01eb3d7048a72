#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libs/map_view/snapshot.h"

namespace mapmend {

// The ground of a map without positions on the earth.
struct GroundPlane3 {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // up, unit length
  double offset = 0;                                  // normal . x on the plane
  double share = 0;                                   // of the points that lie on it, in [0, 1]
};

// The plane with most points of those that could be ground: nearly all cameras are on one side of it, which is up, it
// is not steep against the way that they took, and up is where it is for who holds or flies the camera, give or take 60
// degrees. Random sample consensus (M. Fischler, R. Bolles, 1981), refined; always the same for the same input. A wall
// that is filmed from a flight along it cannot be told from ground filmed from above. Nothing if no such plane holds a
// quarter of the points within tolerance.
//   points, cameras  world_from_camera, any unit
//   tolerance        distance of points that count, same unit
std::optional<GroundPlane3> FindGround(const std::vector<Eigen::Vector3d>& points, const Trajectory& cameras,
                                       double tolerance);

// Puts a component into the frame "level": z is up, the ground horizontal and at height 0 under the first camera, x to
// the right in the picture from above. The unit stays that of the root. Without ground, the camera is taken to be held
// without rolling, and the first camera is at the origin; the note says which it was.
void PlaceLevel(int component, Snapshot* snapshot);

}  // namespace mapmend
