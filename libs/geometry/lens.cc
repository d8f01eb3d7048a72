#include "libs/geometry/lens.h"

#include <Eigen/Dense>
#include <cmath>
#include <limits>

namespace mapmend {
namespace {

using Model = Camera::Model;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kMaxTan = 100;                 // 89.4 degrees
constexpr double kMaxAngle = 3.14159265358979;  // radians

// Radial factors as functions of the radius, where the model has one.
double RadialCurve(const Camera& camera, double r) {
  const auto& d = camera.distortion;
  const double r2 = r * r;
  switch (camera.model) {
    case Model::kPinhole:
      return r * (1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4])));
    case Model::kRational:
      return r * (1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) / (1 + r2 * (d[5] + r2 * (d[6] + r2 * d[7])));
    case Model::kFisheye:
      return r * (1 + r2 * (d[0] + r2 * (d[1] + r2 * (d[2] + r2 * d[3]))));
    case Model::kThinPrismFisheye:
      return r * (1 + r2 * (d[0] + r2 * (d[1] + r2 * (d[4] + r2 * d[5]))));
    case Model::kOmni:
      return r * (1 + r2 * (d[1] + r2 * d[2]));
    default:
      return r;
  }
}

Vector2d Tangential(const Vector2d& p, double p1, double p2) {
  const double r2 = p.squaredNorm();
  return {2 * p1 * p.x() * p.y() + p2 * (r2 + 2 * p.x() * p.x()),
          p1 * (r2 + 2 * p.y() * p.y()) + 2 * p2 * p.x() * p.y()};
}

Vector2d DistortPlane(const Camera& camera, const Vector2d& p) {
  const auto& d = camera.distortion;
  const double r = p.norm(), r2 = r * r;
  const double radial = r > 1e-12 ? RadialCurve(camera, r) / r : 1;
  switch (camera.model) {
    case Model::kPinhole:
      return radial * p + Tangential(p, d[2], d[3]);
    case Model::kOmni:
      return radial * p + Tangential(p, d[3], d[4]);
    case Model::kThinPrismFisheye:
      return radial * p + Tangential(p, d[2], d[3]) + r2 * Vector2d(d[6], d[7]);
    case Model::kRational: {
      const Vector2d q =
          radial * p + Tangential(p, d[2], d[3]) + Vector2d(r2 * (d[8] + r2 * d[9]), r2 * (d[10] + r2 * d[11]));
      if (d[12] == 0 && d[13] == 0) return q;
      // A tilted sensor: turned about x, then y, and projected back along the axis.
      const Matrix3d turn =
          (Eigen::AngleAxisd(-d[13], Vector3d::UnitY()) * Eigen::AngleAxisd(-d[12], Vector3d::UnitX()))
              .toRotationMatrix();
      Matrix3d along = Matrix3d::Identity();
      along << turn(2, 2), 0, -turn(0, 2), 0, turn(2, 2), -turn(1, 2), 0, 0, 1;
      return (along * turn * q.homogeneous()).hnormalized();
    }
    default:
      return p;
  }
}

// Newton's method from the distorted place itself, with differences for derivatives.
std::optional<Vector2d> UndistortPlane(const Camera& camera, const Vector2d& target) {
  constexpr double kStep = 1e-6;
  Vector2d p = target;
  for (int i = 0; i < 50; ++i) {
    const Vector2d error = DistortPlane(camera, p) - target;
    if (error.norm() < 1e-12) break;
    Eigen::Matrix2d jacobian;
    for (int k = 0; k < 2; ++k) {
      const Vector2d h = kStep * Vector2d::Unit(k);
      jacobian.col(k) = (DistortPlane(camera, p + h) - DistortPlane(camera, p - h)) / (2 * kStep);
    }
    if (!(std::abs(jacobian.determinant()) > 1e-9)) return std::nullopt;
    Vector2d step = jacobian.inverse() * error;
    // Half the radius at the most: a step across the fold of the curve would end in another solution.
    const double most = 0.5 * std::max(p.norm(), 0.1);
    if (step.norm() > most) step *= most / step.norm();
    p -= step;
    if (!p.allFinite() || p.norm() > kMaxTan) return std::nullopt;
  }
  if (!((DistortPlane(camera, p) - target).norm() < 1e-7)) return std::nullopt;
  return p;
}

Vector3d RayAtAngle(const Vector2d& direction, double angle) {
  const double r = direction.norm();
  if (r < 1e-12) return Vector3d::UnitZ();
  return {std::sin(angle) * direction.x() / r, std::sin(angle) * direction.y() / r, std::cos(angle)};
}

std::optional<Vector3d> FisheyeRay(const Camera& camera, const Vector2d& plane, double limit) {
  const double r = plane.norm();
  double low = 0, high = limit;
  if (RadialCurve(camera, high) < r) return std::nullopt;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (RadialCurve(camera, middle) < r ? low : high) = middle;
  }
  return RayAtAngle(plane, 0.5 * (low + high));
}

}  // namespace

double RadialLimit(const Camera& camera) {
  const bool angle = camera.model == Model::kFisheye || camera.model == Model::kThinPrismFisheye;
  const double end = angle ? kMaxAngle : kMaxTan;
  // Finer near the axis, where lenses turn back if they do.
  double last = 0, radius = 0;
  for (double step = 1e-3; radius < end; step = std::max(1e-3, 2e-3 * radius)) {
    const double next = RadialCurve(camera, radius + step);
    if (!(next > last)) return radius;
    last = next;
    radius += step;
  }
  return end;
}

double CentralScale(const Camera& camera) {
  const bool sphere = camera.model == Model::kOmni || camera.model == Model::kDoubleSphere;
  return sphere ? 1 / (1 + camera.distortion[0]) : 1;
}

Vector2d Distort(const Camera& camera, const Vector3d& x_cam) {
  const auto& d = camera.distortion;
  const double x = x_cam.x(), y = x_cam.y(), z = x_cam.z(), norm = x_cam.norm();
  const Vector2d p(x / z, y / z);
  const double r = p.norm();
  switch (camera.model) {
    case Model::kPinhole:
    case Model::kRational:
      return DistortPlane(camera, p);
    case Model::kFisheye:
      return r > 1e-12 ? Vector2d(p * (RadialCurve(camera, std::atan(r)) / r)) : p;
    case Model::kThinPrismFisheye:
      return DistortPlane(camera, r > 1e-12 ? Vector2d(p * (std::atan(r) / r)) : p);
    case Model::kFov:
      return r > 1e-12 ? Vector2d(p * (std::atan(2 * r * std::tan(d[0] / 2)) / (d[0] * r)))
                       : Vector2d(p * (2 * std::tan(d[0] / 2) / d[0]));
    case Model::kOmni:
      return DistortPlane(camera, Vector2d(x, y) / (z + d[0] * norm));
    case Model::kDoubleSphere: {
      const double z1 = d[0] * norm + z;
      return Vector2d(x, y) / (d[1] * std::sqrt(x * x + y * y + z1 * z1) + (1 - d[1]) * z1);
    }
    case Model::kExtendedUnified:
      return Vector2d(x, y) / (d[0] * std::sqrt(d[1] * (x * x + y * y) + z * z) + (1 - d[0]) * z);
    case Model::kDivision:
      return p * (2 / (1 + std::sqrt(1 - 4 * d[0] * r * r)));
  }
  return p;
}

std::optional<Vector3d> Ray(const Camera& camera, const Vector2d& plane, double limit) {
  const auto& d = camera.distortion;
  const double r2 = plane.squaredNorm(), r = std::sqrt(r2);
  if (!plane.allFinite()) return std::nullopt;
  switch (camera.model) {
    case Model::kFisheye:
      return FisheyeRay(camera, plane, limit);
    case Model::kFov: {
      const double angle = r * d[0];
      if (angle >= 0.5 * kMaxAngle) return std::nullopt;
      return RayAtAngle(plane, std::atan(std::tan(angle) / (2 * std::tan(d[0] / 2))));
    }
    case Model::kDivision: {
      const double w = 1 + d[0] * r2;
      if (w <= 0) return std::nullopt;
      return Vector3d(plane.x(), plane.y(), w).normalized();
    }
    case Model::kDoubleSphere: {
      const double s2 = 1 - (2 * d[1] - 1) * r2;
      if (s2 < 0) return std::nullopt;
      const double mz = (1 - d[1] * d[1] * r2) / (d[1] * std::sqrt(s2) + 1 - d[1]);
      const double root = mz * mz + (1 - d[0] * d[0]) * r2;
      if (root < 0) return std::nullopt;
      const double k = (mz * d[0] + std::sqrt(root)) / (mz * mz + r2);
      return Vector3d(k * plane.x(), k * plane.y(), k * mz - d[0]).normalized();
    }
    case Model::kExtendedUnified: {
      const double s2 = 1 - (2 * d[0] - 1) * d[1] * r2;
      if (s2 < 0) return std::nullopt;
      return Vector3d(plane.x(), plane.y(), (1 - d[1] * d[0] * d[0] * r2) / (d[0] * std::sqrt(s2) + 1 - d[0]))
          .normalized();
    }
    default:
      break;
  }
  const auto p = UndistortPlane(camera, plane);
  if (!p || p->norm() > limit) return std::nullopt;
  if (camera.model == Model::kThinPrismFisheye) return RayAtAngle(*p, p->norm());
  if (camera.model != Model::kOmni) return p->homogeneous().normalized();
  const double p2 = p->squaredNorm(), root = 1 + (1 - d[0] * d[0]) * p2;
  if (root < 0) return std::nullopt;
  const double lambda = (d[0] + std::sqrt(root)) / (1 + p2);
  return Vector3d(lambda * p->x(), lambda * p->y(), lambda - d[0]).normalized();
}

}  // namespace mapmend
