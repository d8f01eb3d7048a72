#pragma once

#include <Eigen/Core>
#include <optional>

#include "libs/geometry/camera.h"

// The lens models themselves, in both directions, on the normalised image plane: pixel = focal length * plane + centre.
namespace mapmend {

// Where a point (x, y, z) of the camera frame, z > 0, is seen on the plane.
Eigen::Vector2d Distort(const Camera& camera, const Eigen::Vector3d& x_cam);

// The unit ray that is seen at a place of the plane, the first one from the axis outwards. Nothing where the model has
// none: beyond the radius at which its curve turns back, outside its domain, or where the search does not converge.
//   limit  RadialLimit(camera), which takes longer than all the rest
std::optional<Eigen::Vector3d> Ray(const Camera& camera, const Eigen::Vector2d& plane, double limit);

// How far from the axis the model can be inverted, in what its radial curve is a function of: tan of the angle for
// pinhole and rational, the angle for fisheye models, the distance on the plane for omni.
double RadialLimit(const Camera& camera);

// The focal length in the middle of the image is this times fx: 1 but for models of spheres.
double CentralScale(const Camera& camera);

}  // namespace mapmend
