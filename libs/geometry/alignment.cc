#include "libs/geometry/alignment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace mapmend {
namespace {

// Singular values below this fraction of the largest count as zero.
constexpr double kRankTolerance = 1e-9;

Eigen::Vector3d Mean(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) sum += p;
  return sum / static_cast<double>(points.size());
}

std::vector<size_t> OrderByTime(const Trajectory& trajectory) {
  std::vector<size_t> order(trajectory.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return trajectory[a].utime < trajectory[b].utime; });
  return order;
}

// "1525003606.000000 to 1525003672.000000 s"
std::string DescribeTimes(const Trajectory& trajectory) {
  if (trajectory.empty()) return "empty";
  const auto [first, last] =
      std::minmax_element(trajectory.begin(), trajectory.end(),
                          [](const StampedPose& a, const StampedPose& b) { return a.utime < b.utime; });
  return FormatSeconds(first->utime) + " to " + FormatSeconds(last->utime) + " s";
}

}  // namespace

PointAlignment AlignPoints(const std::vector<Eigen::Vector3d>& source, const std::vector<Eigen::Vector3d>& to,
                           AlignmentKind kind) {
  PointAlignment result;
  if (source.size() != to.size() || source.size() < 3) {
    result.reason = "alignment needs at least 3 pairs, there are " + std::to_string(std::min(source.size(), to.size()));
    return result;
  }
  const Eigen::Vector3d source_mean = Mean(source), to_mean = Mean(to);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double source_variance = 0, to_variance = 0;
  for (size_t i = 0; i < source.size(); ++i) {
    const Eigen::Vector3d s = source[i] - source_mean, t = to[i] - to_mean;
    covariance += t * s.transpose();
    source_variance += s.squaredNorm();
    to_variance += t.squaredNorm();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d singular = svd.singularValues();
  const bool same_place = singular[0] <= kRankTolerance * std::sqrt(source_variance * to_variance) || singular[0] == 0;
  if (same_place && kind == AlignmentKind::kSimilarity) {
    result.reason = "the camera does not move, so the scale is unknown";
    return result;
  }
  result.collinear = same_place || singular[1] <= kRankTolerance * singular[0];
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) sign[2] = -1;
  const Eigen::Matrix3d rotation = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  const double scale = kind == AlignmentKind::kSimilarity ? singular.dot(sign) / source_variance : 1.0;
  if (!(scale > 0) || !std::isfinite(scale)) {
    result.reason = "no positive scale fits";
    return result;
  }
  result.success = true;
  result.to_from_source = Similarity3(scale, Eigen::Quaterniond(rotation), to_mean - scale * (rotation * source_mean));
  return result;
}

std::vector<TimePair> AssociateByTime(const Trajectory& estimate, const Trajectory& reference, int64_t tolerance_us) {
  const std::vector<size_t> order = OrderByTime(reference);
  std::vector<std::tuple<int64_t, size_t, size_t>> close;  // |dt|, estimate, reference
  for (size_t i = 0; i < estimate.size(); ++i) {
    const int64_t utime = estimate[i].utime;
    auto it = std::lower_bound(order.begin(), order.end(), utime - tolerance_us,
                               [&](size_t r, int64_t t) { return reference[r].utime < t; });
    for (; it != order.end() && reference[*it].utime <= utime + tolerance_us; ++it) {
      close.emplace_back(std::abs(reference[*it].utime - utime), i, *it);
    }
  }
  std::sort(close.begin(), close.end());
  std::vector<bool> estimate_used(estimate.size(), false), reference_used(reference.size(), false);
  std::vector<TimePair> pairs;
  for (const auto& [dt, e, r] : close) {
    if (estimate_used[e] || reference_used[r]) continue;
    estimate_used[e] = reference_used[r] = true;
    pairs.push_back({e, r});
  }
  std::sort(pairs.begin(), pairs.end(), [](const TimePair& a, const TimePair& b) { return a.estimate < b.estimate; });
  return pairs;
}

Evaluation EvaluateTrajectory(const Trajectory& estimate, const Trajectory& reference,
                              const EvaluationOptions& options) {
  Evaluation result;
  result.num_estimate = estimate.size();
  result.num_reference = reference.size();
  result.pairs = AssociateByTime(estimate, reference, options.tolerance_us);
  if (!reference.empty()) {
    result.coverage = static_cast<double>(result.pairs.size()) / static_cast<double>(reference.size());
  }
  if (result.pairs.empty()) {
    result.reason = "no pose of the estimate (" + DescribeTimes(estimate) + ") is within " +
                    FormatSeconds(options.tolerance_us) + " s of one of the ground truth (" + DescribeTimes(reference) +
                    "): are the times of one clock? --time-offset shifts those of the ground truth";
    return result;
  }
  std::vector<Eigen::Vector3d> source, to;
  for (const TimePair& pair : result.pairs) {
    source.push_back(estimate[pair.estimate].world_from_camera.translation);
    to.push_back(reference[pair.reference].world_from_camera.translation);
  }
  const PointAlignment alignment = AlignPoints(source, to, options.kind);
  if (!alignment.success) {
    result.reason = alignment.reason;
    return result;
  }
  result.success = true;
  result.collinear = alignment.collinear;
  result.reference_from_estimate = alignment.to_from_source;
  double sum = 0, sum_of_squares = 0;
  for (size_t i = 0; i < source.size(); ++i) {
    const double error = (to[i] - alignment.to_from_source * source[i]).norm();
    result.errors.push_back(error);
    sum += error;
    sum_of_squares += error * error;
    if (i == 0 || error > result.max) {
      result.max = error;
      result.max_utime = reference[result.pairs[i].reference].utime;
    }
  }
  const double n = static_cast<double>(source.size());
  result.mean = sum / n;
  result.rmse = std::sqrt(sum_of_squares / n);
  std::vector<double> sorted = result.errors;
  std::sort(sorted.begin(), sorted.end());
  const size_t middle = sorted.size() / 2;
  result.median = sorted.size() % 2 == 1 ? sorted[middle] : 0.5 * (sorted[middle - 1] + sorted[middle]);
  return result;
}

}  // namespace mapmend
