#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "libs/geometry/rigid3.h"
#include "libs/geometry/trajectory_file.h"

// Which way is up in a map whose axes mean nothing yet, and where its ground is. All in the map's frame and unit unless
// told otherwise.
namespace mapmend {

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
//   cameras    poses, in the order of time
//   tolerance  distance of points that count
std::optional<GroundPlane3> FindGroundPlane(const std::vector<Eigen::Vector3d>& points, const Trajectory& cameras,
                                            double tolerance);

// A frame in which z is up, in the map's unit.
struct LevelFrame {
  Rigid3 level_from_map;
  std::optional<GroundPlane3> ground;  // nothing: up was taken from the cameras
};

// The ground is horizontal and at height 0 under the first camera. Without ground, the camera is taken to be held
// without rolling, and the first camera is at the origin. Without cameras, the map's own frame.
//   to_the_right  the level frame's x axis is this direction, made horizontal
LevelFrame FindLevelFrame(const std::vector<Eigen::Vector3d>& points, const Trajectory& cameras,
                          const Eigen::Vector3d& to_the_right);

}  // namespace mapmend
