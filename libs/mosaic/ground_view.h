#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "libs/mosaic/ground_surface.h"

namespace mapmend {

// How a camera moves while it reads an image line by line, in its own frame. Zero: all lines at once.
struct ReadoutMotion {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();  // units of the ground, from the first line to the last
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();   // radians, likewise
  bool by_columns = false;                          // lines are columns, of a camera that was turned

  bool IsZero() const { return shift.isZero(0) && turn.isZero(0); }
};

// A lens, and what is worked out of it once for all its images.
class GroundCamera {
 public:
  explicit GroundCamera(const Camera& camera);

  const Camera& camera() const { return camera_; }
  double central_focal() const { return central_focal_; }
  // Of the angle from the axis at the image's corners: beyond, a lens model may fold back.
  double max_tangent() const { return max_tangent_; }
  // Rays (z = 1) of the image's border that the lens model knows, in order.
  const std::vector<Eigen::Vector3d>& border_rays() const { return border_rays_; }

 private:
  Camera camera_;
  std::vector<Eigen::Vector3d> border_rays_;
  double max_tangent_ = 0, central_focal_ = 1;
};

// What one image shows of the ground: backward projection from places on the ground to pixels, through pose, lens and
// rolling shutter. The ground's frame has z up.
class GroundView {
 public:
  GroundView(std::shared_ptr<const GroundCamera> camera, const Rigid3& cam_from_ground,
             const ReadoutMotion& motion = {});
  GroundView(const Camera& camera, const Rigid3& cam_from_ground, const ReadoutMotion& motion = {})
      : GroundView(std::make_shared<const GroundCamera>(camera), cam_from_ground, motion) {}

  struct Sight {
    Eigen::Vector2d pixel;  // of the image as it was taken, distorted
    double inside = 0;      // distance from the image's border, pixels; negative: outside
    // How well the place is seen but for the border: the cube of the cosine of the angle from the vertical, over the
    // depth.
    double steepness = 0;
    double offset = 0;  // from the image's centre, of half its diagonal
  };
  // Nothing if the place is behind the camera, above it, or where the lens model does not hold.
  std::optional<Sight> Project(const Eigen::Vector3d& place) const;
  // Nothing if the image does not show the place.
  std::optional<Sight> See(const Eigen::Vector3d& place) const;
  // How well a place is seen: its steepness, less near the image's border; 0 outside the image.
  double Quality(double steepness, double inside) const;

  // Where the border of the image meets the surface, in order; rays that go up or far to the side end at 70 degrees
  // from the vertical.
  std::vector<Eigen::Vector2d> Footprint(const GroundSurface& surface) const;
  // Size of a pixel on the ground below the image's centre.
  double GroundSampleDistance(const GroundSurface& surface) const;
  // Between the optical axis and straight down, radians.
  double Tilt() const;
  const Eigen::Vector3d& Center() const { return center_; }
  const Camera& camera() const { return camera_->camera(); }

 private:
  std::optional<Eigen::Vector2d> Meet(const Eigen::Vector3d& ray_cam, const GroundSurface& surface) const;

  std::shared_ptr<const GroundCamera> camera_;
  Rigid3 cam_from_ground_;
  ReadoutMotion motion_;
  bool is_moving_ = false;
  Eigen::Vector3d center_;
  double border_ = 1;  // pixels
};

}  // namespace mapmend
