#include "libs/optim/calibration_cost.h"

#include <algorithm>

#include "libs/geometry/skew.h"
#include "libs/optim/behind_camera.h"

namespace mapmend {
namespace {

// A point of the plane z = 1 as the lens puts it, with all derivatives.
struct Distorted {
  Eigen::Vector2d at;
  Eigen::Matrix2d by_plane;             // d at / d (x, y)
  Eigen::Matrix<double, 2, 4> by_lens;  // d at / d (k1, k2, p1, p2)
};

Distorted DistortPlane(const double* lens, double k3, double x, double y) {
  const double k1 = lens[0], k2 = lens[1], p1 = lens[2], p2 = lens[3];
  const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
  const double radial = 1 + k1 * r2 + k2 * r4 + k3 * r6;
  const double slope = 2 * (k1 + 2 * k2 * r2 + 3 * k3 * r4);  // d radial / d x = slope x
  Distorted d;
  d.at = {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
  d.by_plane << radial + slope * x * x + 2 * p1 * y + 6 * p2 * x, slope * x * y + 2 * p1 * x + 2 * p2 * y,
      slope * x * y + 2 * p1 * x + 2 * p2 * y, radial + slope * y * y + 6 * p1 * y + 2 * p2 * x;
  d.by_lens << x * r2, x * r4, 2 * x * y, r2 + 2 * x * x, y * r2, y * r4, r2 + 2 * y * y, 2 * x * y;
  return d;
}

}  // namespace

Camera WithIntrinsics(const Camera& camera, const Intrinsics& intrinsics) {
  Camera result = camera;
  result.fx *= intrinsics[0];
  result.fy *= intrinsics[0];
  std::copy(intrinsics.begin() + 1, intrinsics.end(), result.distortion.begin());
  return result;
}

Intrinsics IntrinsicsOf(const Camera& camera) {
  return {1, camera.distortion[0], camera.distortion[1], camera.distortion[2], camera.distortion[3]};
}

bool CalibrationCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> point(parameters[1]);
  const double* intrinsics = parameters[2];
  const Eigen::Vector3d rotated = pose_->rotation * point;
  const Eigen::Vector3d x = rotated + pose_->translation;
  Eigen::Map<Eigen::Vector2d> r(residuals);
  const bool behind = x.z() < kMinDepth;
  Eigen::Matrix<double, 2, 3> by_point = Eigen::Matrix<double, 2, 3>::Zero();
  Eigen::Matrix<double, 2, kNumIntrinsics> by_intrinsics = Eigen::Matrix<double, 2, kNumIntrinsics>::Zero();
  if (behind) {
    r.setConstant(kResidualBehindCamera);
  } else {
    const double iz = 1 / x.z(), px = x.x() * iz, py = x.y() * iz;
    const Distorted d = DistortPlane(intrinsics + 1, camera_->distortion[4], px, py);
    const Eigen::Vector2d focal(camera_->fx, camera_->fy);
    const Eigen::Vector2d scaled = focal * (intrinsics[0] * inverse_sigma_);
    r = scaled.cwiseProduct(d.at) + (Eigen::Vector2d(camera_->cx, camera_->cy) - pixel_) * inverse_sigma_;
    Eigen::Matrix<double, 2, 3> plane;
    plane << iz, 0, -px * iz, 0, iz, -py * iz;
    by_point = scaled.asDiagonal() * d.by_plane * plane;
    by_intrinsics << focal.cwiseProduct(d.at) * inverse_sigma_, scaled.asDiagonal() * d.by_lens;
  }
  if (jacobians == nullptr) return true;
  if (jacobians[0] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> j(jacobians[0]);
    j.leftCols<3>() = by_point;
    j.rightCols<3>() = -by_point * Skew(rotated) * pose_->left_jacobian;
  }
  if (jacobians[1] != nullptr)
    Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>{jacobians[1]} = by_point * pose_->rotation;
  if (jacobians[2] != nullptr)
    Eigen::Map<Eigen::Matrix<double, 2, kNumIntrinsics, Eigen::RowMajor>>{jacobians[2]} = by_intrinsics;
  return true;
}

}  // namespace mapmend
