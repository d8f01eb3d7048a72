#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "libs/mosaic/ground_surface.h"

namespace mapmend {

// What one image shows of the ground: backward projection from places on the ground to pixels, through pose and lens.
// The ground's frame has z up.
class GroundView {
 public:
  GroundView(const Camera& camera, const Rigid3& cam_from_ground);

  struct Sight {
    Eigen::Vector2d pixel;  // of the image as it was taken, distorted
    // How well the place is seen, in (0, 1] times the reciprocal of the depth: by the angle from the vertical, the
    // distance, and the distance from the image's border.
    double quality = 0;
    double offset = 0;  // from the image's centre, of half its diagonal
  };
  // Nothing if the image does not show the place.
  std::optional<Sight> See(const Eigen::Vector3d& place) const;

  // Where the border of the image meets the surface, in order; rays that go up or far to the side end at 70 degrees
  // from the vertical.
  std::vector<Eigen::Vector2d> Footprint(const GroundSurface& surface) const;
  // Size of a pixel on the ground below the image's centre.
  double GroundSampleDistance(const GroundSurface& surface) const;
  // Between the optical axis and straight down, radians.
  double Tilt() const;
  const Eigen::Vector3d& Center() const { return center_; }

 private:
  std::optional<Eigen::Vector2d> Meet(const Eigen::Vector3d& ray_cam, const GroundSurface& surface) const;

  Camera camera_;
  Rigid3 cam_from_ground_;
  Eigen::Vector3d center_;
  double max_tangent_ = 0;  // of the angle from the axis at the image's corners: beyond, a lens model may fold back
  double central_focal_ = 1;
};

}  // namespace mapmend
