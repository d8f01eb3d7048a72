#include "libs/positioning/similarity_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "libs/base/median.h"
#include "libs/base/random.h"
#include "libs/geometry/alignment.h"
#include "libs/geometry/skew.h"

namespace mapmend {
namespace {

using Vector7 = Eigen::Matrix<double, 7, 1>;

constexpr int kSamples = 400, kScored = 200, kIterations = 30;
constexpr double kChiMedian3 = 1.538;  // median length of three normal numbers
constexpr double kCauchy = 2.385;      // 95 % as good as least squares on normal errors (Holland and Welsch 1977)

Eigen::Vector3d RotationVector(const Eigen::Quaterniond& q) {
  const Eigen::AngleAxisd turn(q.w() < 0 ? Eigen::Quaterniond(-q.coeffs()) : q);
  return turn.angle() * turn.axis();
}

Eigen::Vector3d Sigmas(const PositionPair& pair) {
  return {pair.sigma_horizontal, pair.sigma_horizontal, pair.sigma_vertical};
}

std::optional<Similarity3> Align(const std::vector<const PositionPair*>& pairs) {
  std::vector<Eigen::Vector3d> map, enu;
  for (const PositionPair* pair : pairs) {
    map.push_back(pair->map);
    enu.push_back(pair->enu);
  }
  if (map.size() < 3) return std::nullopt;
  const PointAlignment alignment = AlignPoints(map, enu, AlignmentKind::kSimilarity);
  if (!alignment.success || !(alignment.to_from_source.scale > 0)) return std::nullopt;
  return alignment.to_from_source;
}

double TruncatedCost(const std::vector<PositionPair>& pairs, const Similarity3& transform, double limit) {
  const size_t step = std::max<size_t>(1, pairs.size() / kScored);
  double cost = 0;
  for (size_t i = 0; i < pairs.size(); i += step)
    cost += std::min(limit * limit, WhitenedResidual(pairs[i], transform).squaredNorm());
  return cost;
}

std::optional<Similarity3> Guess(const std::vector<PositionPair>& pairs) {
  std::optional<Similarity3> best = LeastSquaresSimilarity(pairs);
  constexpr double kLimit = 4;
  double lowest = best ? TruncatedCost(pairs, *best, kLimit) : std::numeric_limits<double>::infinity();
  Random random(1);
  const int n = static_cast<int>(pairs.size());
  for (int i = 0; i < kSamples; ++i) {
    std::vector<const PositionPair*> sample;
    for (int k = 0; k < 3; ++k) sample.push_back(&pairs[static_cast<size_t>(random.Below(n))]);
    const auto candidate = Align(sample);
    if (!candidate) continue;
    const double cost = TruncatedCost(pairs, *candidate, kLimit);
    if (cost >= lowest) continue;
    lowest = cost;
    best = candidate;
  }
  return best;
}

// Standard deviations of the residuals in those that were told, whatever the outliers say.
double Spread(const std::vector<PositionPair>& pairs, const Similarity3& transform) {
  std::vector<double> lengths;
  for (const PositionPair& pair : pairs) lengths.push_back(WhitenedResidual(pair, transform).norm());
  return std::max(0.05, Median(std::move(lengths)) / kChiMedian3);
}

// Weighted normal equations of a change from the left about the centre: translation, rotation, log of the scale.
struct NormalEquations {
  Matrix7 H = Matrix7::Zero();
  Vector7 g = Vector7::Zero();

  void Add(const PositionPair& pair, const Similarity3& transform, const Eigen::Vector3d& center, double weight) {
    const Eigen::Vector3d arm = transform * pair.map - center;
    const Eigen::Vector3d inverse = Sigmas(pair).cwiseInverse();
    Eigen::Matrix<double, 3, 7> J;
    J << Eigen::Matrix3d::Identity(), -Skew(arm), arm;
    J = inverse.asDiagonal() * J;
    H += weight * J.transpose() * J;
    g += weight * J.transpose() * WhitenedResidual(pair, transform);
  }
  void Add(const RotationHint& hint, const Similarity3& transform) {
    const double information = 1 / (hint.sigma_rad * hint.sigma_rad);
    const Eigen::Vector3d error = RotationVector(transform.rotation * hint.enu_from_map.conjugate());
    H.block<3, 3>(3, 3).diagonal().array() += information;
    g.segment<3>(3) += information * error;
  }
};

Similarity3 Changed(const Similarity3& transform, const Vector7& step, const Eigen::Vector3d& center) {
  const Eigen::Vector3d turn = step.segment<3>(3);
  const double angle = turn.norm();
  const Eigen::Quaterniond rotation(
      Eigen::AngleAxisd(angle, angle > 0 ? Eigen::Vector3d(turn / angle) : Eigen::Vector3d(Eigen::Vector3d::UnitX())));
  const double factor = std::exp(std::clamp(step(6), -0.5, 0.5));
  const Similarity3 change(factor, rotation, center + step.head<3>() - factor * (rotation * center));
  return change * transform;
}

}  // namespace

Eigen::Vector3d WhitenedResidual(const PositionPair& pair, const Similarity3& enu_from_map) {
  return (enu_from_map * pair.map - pair.enu).cwiseQuotient(Sigmas(pair));
}

std::optional<Similarity3> LeastSquaresSimilarity(const std::vector<PositionPair>& pairs) {
  std::vector<const PositionPair*> all;
  for (const PositionPair& pair : pairs) all.push_back(&pair);
  return Align(all);
}

SimilarityFit FitSimilarity(const std::vector<PositionPair>& pairs, const std::optional<RotationHint>& hint,
                            const std::optional<Similarity3>& guess) {
  SimilarityFit fit;
  const std::optional<Similarity3> start = guess ? guess : Guess(pairs);
  if (!start || pairs.size() < 3) return fit;
  Similarity3 transform = *start;
  for (const PositionPair& pair : pairs) fit.center += pair.enu / static_cast<double>(pairs.size());
  fit.weights.assign(pairs.size(), 1);
  NormalEquations equations;
  for (int i = 0; i < kIterations; ++i) {
    fit.spread = Spread(pairs, transform);
    equations = {};
    for (size_t k = 0; k < pairs.size(); ++k) {
      const double relative = WhitenedResidual(pairs[k], transform).norm() / (kCauchy * fit.spread);
      fit.weights[k] = 1 / (1 + relative * relative);
      equations.Add(pairs[k], transform, fit.center, fit.weights[k] / (fit.spread * fit.spread));
    }
    if (hint) equations.Add(*hint, transform);
    // So little that it only keeps what is open from running away.
    Matrix7 damped = equations.H;
    damped.diagonal() *= 1 + 1e-9;
    damped.diagonal().array() += 1e-9;
    const Vector7 step = damped.ldlt().solve(-equations.g);
    if (!step.allFinite()) return fit;
    transform = Changed(transform, step, fit.center);
    if (step.norm() < 1e-10) break;
  }
  fit.enu_from_map = transform;
  fit.cost = 0;
  for (const PositionPair& pair : pairs)
    fit.cost += std::log1p(WhitenedResidual(pair, transform).squaredNorm()) / static_cast<double>(pairs.size());
  Matrix7 H = equations.H;
  H.diagonal().array() += 1e-12;
  fit.covariance = H.ldlt().solve(Matrix7::Identity());
  fit.success = fit.covariance.allFinite() && transform.translation.allFinite();
  return fit;
}

}  // namespace mapmend
