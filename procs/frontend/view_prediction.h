#pragma once

#include <Eigen/Core>
#include <optional>

#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

// A camera at one pose, ready to be asked about many points.
struct Viewpoint {
  Viewpoint(const Pinhole& pinhole, const Rigid3& cam_from_submap)
      : camera(pinhole),
        rotation(cam_from_submap.rotation.toRotationMatrix()),
        translation(cam_from_submap.translation),
        center(cam_from_submap.Center()) {}

  Pinhole camera;
  Eigen::Matrix3d rotation;  // cam_from_submap, with translation
  Eigen::Vector3d translation;
  Eigen::Vector3d center;  // submap frame
};

// Where a point would be seen.
struct PredictedView {
  Eigen::Vector2d pixel;
  double distance = 0;  // from the camera's centre; WorkingMap::PredictOctave tells the octave
};

inline bool IsInImage(const Pinhole& camera, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < camera.width && pixel.y() < camera.height;
}

constexpr double kFromAnyDirection = -2;  // below every cosine

// None if the point lies behind the camera or outside its image, or would be seen from a direction whose cosine with
// the usual one is below min_view_cos.
inline std::optional<PredictedView> PredictView(const Viewpoint& from, const WorkingPoint& point, double min_view_cos) {
  const Eigen::Vector3d x = from.rotation * point.position + from.translation;
  if (x.z() <= 0) return std::nullopt;
  PredictedView view;
  view.pixel = from.camera.Project(x);
  if (!IsInImage(from.camera, view.pixel)) return std::nullopt;
  const Eigen::Vector3d to_camera = from.center - point.position;
  view.distance = to_camera.norm();
  if (to_camera.dot(point.normal) < min_view_cos * view.distance) return std::nullopt;
  return view;
}

}  // namespace mapmend
