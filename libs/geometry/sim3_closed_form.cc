#include "libs/geometry/sim3_closed_form.h"

#include <Eigen/Dense>
#include <cmath>

namespace mapmend {

std::optional<Similarity3> HornAlignment(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b) {
  const size_t n = a.size();
  if (n < 3 || b.size() != n) return std::nullopt;
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < n; ++i) {
    mean_a += a[i];
    mean_b += b[i];
  }
  mean_a /= static_cast<double>(n);
  mean_b /= static_cast<double>(n);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double var_a = 0, var_b = 0;
  for (size_t i = 0; i < n; ++i) {
    covariance += (b[i] - mean_b) * (a[i] - mean_a).transpose();
    var_a += (a[i] - mean_a).squaredNorm();
    var_b += (b[i] - mean_b).squaredNorm();
  }
  if (!(var_a > 0) || !(var_b > 0)) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // The second singular value vanishes when either point set lies on a line.
  if (!(svd.singularValues()(1) > 1e-9 * svd.singularValues()(0))) return std::nullopt;
  Eigen::Vector3d sign(1, 1, 1);
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) sign(2) = -1;
  const Eigen::Matrix3d rotation = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  const double scale = std::sqrt(var_b / var_a);
  return Similarity3(scale, Eigen::Quaterniond(rotation), mean_b - scale * (rotation * mean_a));
}

}  // namespace mapmend
