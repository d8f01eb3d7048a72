#include "libs/geometry/sim3_closed_form.h"

#include <Eigen/Dense>
#include <cmath>

#include "libs/base/median.h"

namespace mapmend {
namespace {

// Where most of the points are: medians of the coordinates, and the median distance from there.
struct Middle {
  Eigen::Vector3d point;
  double radius = 0;
};

Middle MiddleOf(const std::vector<Eigen::Vector3d>& points) {
  Middle middle;
  std::vector<double> values(points.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < points.size(); ++i) values[i] = points[i][axis];
    middle.point[axis] = Median(values);
  }
  for (size_t i = 0; i < points.size(); ++i) values[i] = (points[i] - middle.point).norm();
  middle.radius = Median(values);
  return middle;
}

}  // namespace

std::optional<Similarity3> HornAlignment(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                                         const std::vector<double>& weights) {
  const size_t n = a.size();
  if (n < 3 || b.size() != n) return std::nullopt;
  const auto weight = [&](size_t i) { return weights.empty() ? 1.0 : weights[i]; };
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = Eigen::Vector3d::Zero();
  double sum = 0;
  for (size_t i = 0; i < n; ++i) {
    mean_a += weight(i) * a[i];
    mean_b += weight(i) * b[i];
    sum += weight(i);
  }
  mean_a /= sum;
  mean_b /= sum;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double var_a = 0, var_b = 0;
  for (size_t i = 0; i < n; ++i) {
    covariance += weight(i) * (b[i] - mean_b) * (a[i] - mean_a).transpose();
    var_a += weight(i) * (a[i] - mean_a).squaredNorm();
    var_b += weight(i) * (b[i] - mean_b).squaredNorm();
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

std::optional<Similarity3> RobustAlignment(const std::vector<Eigen::Vector3d>& a,
                                           const std::vector<Eigen::Vector3d>& b) {
  const size_t n = a.size();
  if (n < 3 || b.size() != n) return std::nullopt;
  const Middle middle_a = MiddleOf(a), middle_b = MiddleOf(b);
  if (!(middle_a.radius > 0) || !(middle_b.radius > 0)) return std::nullopt;
  std::vector<double> prior(n);  // 1 / distance^2, of whichever side says that it is farther
  for (size_t i = 0; i < n; ++i) {
    prior[i] = 1 / (1 + std::max((a[i] - middle_a.point).squaredNorm() / (middle_a.radius * middle_a.radius),
                                 (b[i] - middle_b.point).squaredNorm() / (middle_b.radius * middle_b.radius)));
  }
  std::optional<Similarity3> fit = HornAlignment(a, b, prior);
  constexpr int kMaxIterations = 50;
  for (int iteration = 0; fit && iteration < kMaxIterations; ++iteration) {
    std::vector<double> errors(n);  // relative to the distance
    for (size_t i = 0; i < n; ++i) {
      errors[i] = (b[i] - *fit * a[i]).norm() * std::sqrt(prior[i]) / middle_b.radius;
    }
    constexpr double kExact = 1e-12;
    const double sigma = Median(errors);
    if (sigma < kExact) break;
    std::vector<double> weights(n);
    for (size_t i = 0; i < n; ++i) weights[i] = prior[i] / (1 + errors[i] * errors[i] / (sigma * sigma));
    const std::optional<Similarity3> next = HornAlignment(a, b, weights);
    constexpr double kConverged = 1e-9;
    const bool converged = next && std::abs(next->scale / fit->scale - 1) < kConverged &&
                           (next->translation - fit->translation).norm() < kConverged * middle_b.radius;
    fit = next;
    if (converged) break;
  }
  return fit;
}

}  // namespace mapmend
