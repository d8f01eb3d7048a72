#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>

namespace mapmend {

// Rigid transform b_from_a: x_b = rotation * x_a + translation. Rotation is a unit quaternion.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Rigid3() = default;
  Rigid3(const Eigen::Quaterniond& q, const Eigen::Vector3d& t) : rotation(q.normalized()), translation(t) {}
  Rigid3(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) : Rigid3(Eigen::Quaterniond(R), t) {}

  Rigid3 Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return {inverse, -(inverse * translation)};
  }
  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return rotation * x + translation; }
  // c_from_a = c_from_b * b_from_a
  Rigid3 operator*(const Rigid3& other) const {
    return {rotation * other.rotation, rotation * other.translation + translation};
  }
  // Where a's origin of view is: for cam_from_world, the camera centre in the world.
  Eigen::Vector3d Center() const { return -(rotation.conjugate() * translation); }
};

// tx ty tz qx qy qz qw, the order of TUM files and of every mapmend message.
inline std::array<double, 7> ToArray(const Rigid3& t) {
  return {t.translation.x(), t.translation.y(), t.translation.z(), t.rotation.x(),
          t.rotation.y(),    t.rotation.z(),    t.rotation.w()};
}

inline Rigid3 RigidFromArray(const double* v) {
  return {Eigen::Quaterniond(v[6], v[3], v[4], v[5]), Eigen::Vector3d(v[0], v[1], v[2])};
}

// Angle of a rotation, radians in [0, pi].
inline double RotationAngle(const Eigen::Quaterniond& q) { return 2.0 * std::atan2(q.vec().norm(), std::abs(q.w())); }

}  // namespace mapmend
