#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <optional>

#include "libs/geometry/rigid3.h"

namespace mapmend {

// Point seen along two rays (camera coordinates, z = 1), in the frame of a: linear least squares of the four equations
// x_b cross (R x_a + t) = 0. nullopt if the rays are parallel or the point lies behind a camera.
inline std::optional<Eigen::Vector3d> Triangulate(const Eigen::Vector3d& ray_a, const Eigen::Vector3d& ray_b,
                                                  const Rigid3& b_from_a) {
  const Eigen::Matrix3d R = b_from_a.rotation.toRotationMatrix();
  const Eigen::Vector3d& t = b_from_a.translation;
  Eigen::Matrix<double, 4, 3> A;
  Eigen::Vector4d y;
  A.row(0) << 1, 0, -ray_a.x();
  A.row(1) << 0, 1, -ray_a.y();
  A.row(2) = R.row(0) - ray_b.x() * R.row(2);
  A.row(3) = R.row(1) - ray_b.y() * R.row(2);
  y << 0, 0, ray_b.x() * t.z() - t.x(), ray_b.y() * t.z() - t.y();
  const Eigen::Matrix3d N = A.transpose() * A;
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(N);
  if (ldlt.info() != Eigen::Success || ldlt.vectorD().minCoeff() < 1e-12) return std::nullopt;
  const Eigen::Vector3d x = ldlt.solve(A.transpose() * y);
  if (!x.allFinite() || x.z() <= 0 || (b_from_a * x).z() <= 0) return std::nullopt;
  return x;
}

// Cosine of the angle at point between the directions to two camera centres.
inline double CosIntersectionAngle(const Eigen::Vector3d& point, const Eigen::Vector3d& center_a,
                                   const Eigen::Vector3d& center_b) {
  const Eigen::Vector3d a = center_a - point, b = center_b - point;
  return a.dot(b) / (a.norm() * b.norm());
}

}  // namespace mapmend
