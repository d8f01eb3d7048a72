#pragma once

#include <Eigen/Core>

namespace mapmend {

// The matrix of the cross product: Skew(v) * x = v x x.
inline Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace mapmend
