#pragma once

#include "libs/geometry/camera.h"

namespace mapmend {

// The lens of a session; one that is not told is taken for ideal.
inline Camera LensOf(const Camera& camera, const Pinhole& ideal) {
  if (camera.width > 0 && camera.height > 0 && camera.fx > 0) return camera;
  Camera lens;
  lens.width = ideal.width;
  lens.height = ideal.height;
  lens.fx = ideal.fx;
  lens.fy = ideal.fy;
  lens.cx = ideal.cx;
  lens.cy = ideal.cy;
  return lens;
}

// From the pixels that the map has, of the ideal camera, to those of an image as it was taken, which may be of another
// size than the one that was tracked.
class ImagePixels {
 public:
  // camera: of the session.  width, height: of the image
  ImagePixels(const Camera& camera, const Pinhole& ideal, int width, int height)
      : camera_(LensOf(camera, ideal).Resized(width, height)), ideal_(ideal) {}

  Eigen::Vector2d FromIdeal(const Eigen::Vector2d& pixel) const { return FromCamera(ideal_.Unproject(pixel)); }
  // point: in front of the camera
  Eigen::Vector2d FromCamera(const Eigen::Vector3d& point) const { return camera_.Project(point); }
  const Camera& GetCamera() const { return camera_; }

 private:
  Camera camera_;
  Pinhole ideal_;
};

}  // namespace mapmend
