#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "libs/geometry/camera.h"
#include "libs/geometry/similarity3.h"

namespace mapmend {

// A map point of one submap seen in a keyframe of another.
struct CrossObservation {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // frame of the submap that owns the point
  Rigid3 cam_from_target;                           // keyframe of the other ("target") submap
  Pinhole camera;                                   // of that keyframe
  Eigen::Vector2d pixel;                            // where it is seen there
  double sigma = 1;                                 // standard deviation of the pixel
};

// Observations both ways between two submaps a and b.
struct CrossObservations {
  std::vector<CrossObservation> a_in_b;  // points of a in keyframes of b
  std::vector<CrossObservation> b_in_a;  // points of b in keyframes of a

  size_t Size() const { return a_in_b.size() + b_in_a.size(); }
};

// Squared reprojection error in units of sigma; infinite behind the camera.
inline double SquaredError(const CrossObservation& o, const Similarity3& target_from_source) {
  const Eigen::Vector3d x = o.cam_from_target * (target_from_source * o.point);
  if (!(x.z() > 0)) return std::numeric_limits<double>::infinity();
  return (o.camera.Project(x) - o.pixel).squaredNorm() / (o.sigma * o.sigma);
}

}  // namespace mapmend
