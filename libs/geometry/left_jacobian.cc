#include "libs/geometry/left_jacobian.h"

#include <cmath>

#include "libs/geometry/skew.h"

namespace mapmend {
namespace {

constexpr double kSmallAngle = 1e-5;  // below, the series' next term is lost in rounding

}  // namespace

Eigen::Matrix3d LeftJacobian(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const Eigen::Matrix3d W = Skew(w);
  if (angle < kSmallAngle) return Eigen::Matrix3d::Identity() + 0.5 * W;
  const double squared = angle * angle;
  return Eigen::Matrix3d::Identity() + (1 - std::cos(angle)) / squared * W +
         (angle - std::sin(angle)) / (squared * angle) * W * W;
}

}  // namespace mapmend
