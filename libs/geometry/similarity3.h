#pragma once

#include <array>

#include "libs/geometry/rigid3.h"

namespace mapmend {

// Similarity transform b_from_a: x_b = scale * (rotation * x_a) + translation, scale > 0.
struct Similarity3 {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Similarity3() = default;
  Similarity3(double s, const Eigen::Quaterniond& q, const Eigen::Vector3d& t)
      : scale(s), rotation(q.normalized()), translation(t) {}
  explicit Similarity3(const Rigid3& rigid) : rotation(rigid.rotation), translation(rigid.translation) {}

  Similarity3 Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return {1.0 / scale, inverse, -(inverse * translation) / scale};
  }
  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }
  // c_from_a = c_from_b * b_from_a
  Similarity3 operator*(const Similarity3& other) const {
    return {scale * other.scale, rotation * other.rotation, scale * (rotation * other.translation) + translation};
  }
};

// tx ty tz qx qy qz qw scale, the order of every mapmend message.
inline std::array<double, 8> ToArray(const Similarity3& t) {
  return {t.translation.x(), t.translation.y(), t.translation.z(), t.rotation.x(),
          t.rotation.y(),    t.rotation.z(),    t.rotation.w(),    t.scale};
}

inline Similarity3 SimilarityFromArray(const double* v) {
  return {v[7], Eigen::Quaterniond(v[6], v[3], v[4], v[5]), Eigen::Vector3d(v[0], v[1], v[2])};
}

// Pose of a camera after its world is mapped by new_from_old: cam_from_new with the lengths of the new world.
// A point seen at pixel u before is seen at u after.
inline Rigid3 TransformWorld(const Rigid3& cam_from_old, const Similarity3& new_from_old) {
  const Eigen::Quaterniond rotation = cam_from_old.rotation * new_from_old.rotation.conjugate();
  const Eigen::Vector3d center = new_from_old * cam_from_old.Center();
  return {rotation, -(rotation * center)};
}

}  // namespace mapmend
