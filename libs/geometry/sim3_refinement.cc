#include "libs/geometry/sim3_refinement.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "libs/base/median.h"
#include "libs/base/options.h"
#include "libs/geometry/skew.h"

namespace mapmend {
namespace {

Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& omega) {
  const double angle = omega.norm();
  const double k = angle > 1e-9 ? std::sin(angle / 2) / angle : 0.5 - angle * angle / 48;
  return {std::cos(angle / 2), k * omega.x(), k * omega.y(), k * omega.z()};
}

Eigen::Vector3d LogRotation(Eigen::Quaterniond q) {
  if (q.w() < 0) q.coeffs() *= -1;
  const double n = q.vec().norm();
  if (n < 1e-12) return 2 * q.vec();
  return 2 * std::atan2(n, q.w()) / n * q.vec();
}

// Residual of x in the target's frame, and its derivative by d given that of x.
bool Project(const CrossObservation& o, const Eigen::Vector3d& x_target, const Eigen::Matrix<double, 3, 7>& dx,
             Eigen::Vector2d* residual, Eigen::Matrix<double, 2, 7>* jacobian) {
  const Eigen::Vector3d x = o.cam_from_target * x_target;
  if (!(x.z() > 1e-9)) return false;
  const double iz = 1 / x.z(), is = 1 / o.sigma;
  *residual = (o.camera.Project(x) - o.pixel) * is;
  if (jacobian) {
    Eigen::Matrix<double, 2, 3> projection;
    projection << o.camera.fx * iz, 0, -o.camera.fx * x.x() * iz * iz, 0, o.camera.fy * iz,
        -o.camera.fy * x.y() * iz * iz;
    *jacobian = is * projection * o.cam_from_target.rotation.toRotationMatrix() * dx;
  }
  return true;
}

double HuberCost(double squared, double delta) {
  return squared <= delta * delta ? squared : 2 * delta * std::sqrt(squared) - delta * delta;
}

class Problem {
 public:
  Problem(const CrossObservations& observations, double huber) : observations_(observations), huber_(huber) {}

  // Robust cost over the observations in use; a point behind a camera costs as much as one far outside.
  double Cost(const Similarity3& t, const std::vector<char>& use_ab, const std::vector<char>& use_ba) const {
    double cost = 0;
    ForEach(use_ab, use_ba, [&](const CrossObservation& o, bool a_in_b) {
      Eigen::Vector2d r;
      const bool ok = a_in_b ? ResidualAInB(o, t, &r, nullptr) : ResidualBInA(o, t, &r, nullptr);
      cost += HuberCost(ok ? r.squaredNorm() : 1e6, huber_);
    });
    return cost;
  }

  void Normal(const Similarity3& t, const std::vector<char>& use_ab, const std::vector<char>& use_ba, Matrix7d* H,
              Vector7d* g) const {
    H->setZero();
    g->setZero();
    ForEach(use_ab, use_ba, [&](const CrossObservation& o, bool a_in_b) {
      Eigen::Vector2d r;
      Eigen::Matrix<double, 2, 7> J;
      if (!(a_in_b ? ResidualAInB(o, t, &r, &J) : ResidualBInA(o, t, &r, &J))) return;
      const double e = r.norm();
      const double weight = e <= huber_ ? 1 : huber_ / e;
      const Eigen::Matrix<double, 7, 2> weighted = weight * J.transpose();
      H->noalias() += weighted.lazyProduct(J);
      g->noalias() += weighted.lazyProduct(r);
    });
  }

 private:
  template <typename Visit>
  void ForEach(const std::vector<char>& use_ab, const std::vector<char>& use_ba, Visit visit) const {
    for (size_t i = 0; i < observations_.a_in_b.size(); ++i) {
      if (use_ab[i]) visit(observations_.a_in_b[i], true);
    }
    for (size_t i = 0; i < observations_.b_in_a.size(); ++i) {
      if (use_ba[i]) visit(observations_.b_in_a[i], false);
    }
  }

  const CrossObservations& observations_;
  double huber_;
};

// Levenberg-Marquardt over the observations that are inliers.
Similarity3 Minimise(const Problem& problem, const Sim3RefinementResult& inliers, int max_iterations, Similarity3 t) {
  constexpr int kMaxAttempts = 6;
  constexpr double kMinGain = 1e-6;  // of the cost
  double cost = problem.Cost(t, inliers.inlier_a_in_b, inliers.inlier_b_in_a);
  double damping = 1e-4;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    Matrix7d H;
    Vector7d g;
    problem.Normal(t, inliers.inlier_a_in_b, inliers.inlier_b_in_a, &H, &g);
    bool improved = false;
    double gain = 0;
    for (int attempt = 0; attempt < kMaxAttempts && !improved; ++attempt) {
      Matrix7d damped = H;
      damped.diagonal() += damping * H.diagonal();
      const Vector7d step = damped.ldlt().solve(-g);
      if (step.allFinite()) {
        const Similarity3 next = Perturb(t, step);
        const double next_cost = problem.Cost(next, inliers.inlier_a_in_b, inliers.inlier_b_in_a);
        if (next_cost < cost) {
          improved = true;
          gain = (cost - next_cost) / cost;
          t = next;
          cost = next_cost;
          damping = std::max(1e-9, damping / 10);
          continue;
        }
      }
      damping *= 10;
    }
    if (!improved || gain < kMinGain) break;
  }
  return t;
}

// Which observations the transform explains.
void MarkInliers(const CrossObservations& observations, const Similarity3& t, double max_squared_error,
                 Sim3RefinementResult* result) {
  const Similarity3 inverse = t.Inverse();
  result->num_inliers = 0;
  for (size_t i = 0; i < observations.a_in_b.size(); ++i) {
    result->inlier_a_in_b[i] = SquaredError(observations.a_in_b[i], t) <= max_squared_error;
    result->num_inliers += result->inlier_a_in_b[i];
  }
  for (size_t i = 0; i < observations.b_in_a.size(); ++i) {
    result->inlier_b_in_a[i] = SquaredError(observations.b_in_a[i], inverse) <= max_squared_error;
    result->num_inliers += result->inlier_b_in_a[i];
  }
}

// Pixels, over the inliers.
double MedianError(const CrossObservations& observations, const Similarity3& t, const Sim3RefinementResult& inliers) {
  const Similarity3 inverse = t.Inverse();
  std::vector<double> errors;
  for (size_t i = 0; i < observations.a_in_b.size(); ++i) {
    const CrossObservation& o = observations.a_in_b[i];
    if (inliers.inlier_a_in_b[i]) errors.push_back(o.sigma * std::sqrt(SquaredError(o, t)));
  }
  for (size_t i = 0; i < observations.b_in_a.size(); ++i) {
    const CrossObservation& o = observations.b_in_a[i];
    if (inliers.inlier_b_in_a[i]) errors.push_back(o.sigma * std::sqrt(SquaredError(o, inverse)));
  }
  return Median(std::move(errors));
}

}  // namespace

Similarity3 Perturb(const Similarity3& b_from_a, const Vector7d& d) {
  return {b_from_a.scale * std::exp(d(6)), ExpRotation(d.head<3>()) * b_from_a.rotation,
          b_from_a.translation + d.segment<3>(3)};
}

Vector7d Difference(const Similarity3& from, const Similarity3& to) {
  Vector7d d;
  d << LogRotation(to.rotation * from.rotation.conjugate()), to.translation - from.translation,
      std::log(to.scale / from.scale);
  return d;
}

Eigen::Matrix<double, 3, 7> PlaceJacobian(const Similarity3& b_from_a, const Eigen::Vector3d& point_in_a) {
  const Eigen::Vector3d turned = b_from_a.scale * (b_from_a.rotation * point_in_a);
  Eigen::Matrix<double, 3, 7> jacobian;
  jacobian << -Skew(turned), Eigen::Matrix3d::Identity(), turned;
  return jacobian;
}

bool ResidualAInB(const CrossObservation& o, const Similarity3& b_from_a, Eigen::Vector2d* residual,
                  Eigen::Matrix<double, 2, 7>* jacobian) {
  // x = exp(lambda) exp(omega) v + t + upsilon with v = s R p.
  const Eigen::Vector3d v = b_from_a.scale * (b_from_a.rotation * o.point);
  Eigen::Matrix<double, 3, 7> dx;
  if (jacobian) dx << -Skew(v), Eigen::Matrix3d::Identity(), v;
  return Project(o, v + b_from_a.translation, dx, residual, jacobian);
}

bool ResidualBInA(const CrossObservation& o, const Similarity3& b_from_a, Eigen::Vector2d* residual,
                  Eigen::Matrix<double, 2, 7>* jacobian) {
  // x = exp(-lambda) / s R^T exp(-omega) (p - t - upsilon).
  const Eigen::Matrix3d inverse = b_from_a.rotation.conjugate().toRotationMatrix() / b_from_a.scale;
  const Eigen::Vector3d v = o.point - b_from_a.translation;
  const Eigen::Vector3d x = inverse * v;
  Eigen::Matrix<double, 3, 7> dx;
  if (jacobian) dx << inverse * Skew(v), -inverse, -x;
  return Project(o, x, dx, residual, jacobian);
}

std::string Sim3RefinementOptions::Check() const { return CheckOptions(*this); }

Sim3RefinementResult RefineSim3(const CrossObservations& observations, const Similarity3& initial,
                                const Sim3RefinementOptions& options) {
  Sim3RefinementResult result;
  result.b_from_a = initial;
  result.inlier_a_in_b.assign(observations.a_in_b.size(), 1);
  result.inlier_b_in_a.assign(observations.b_in_a.size(), 1);
  result.information.setZero();
  const Problem problem(observations, options.huber);

  constexpr int kMinInliers = 4;
  Similarity3 t = initial;
  for (int round = 0; round < options.num_rounds; ++round) {
    t = Minimise(problem, result, options.max_iterations, t);
    // Who belongs to it, now that the transform is better?
    MarkInliers(observations, t, options.max_squared_error, &result);
    if (result.num_inliers < kMinInliers) return result;
  }
  result.b_from_a = t;
  result.initial_cost = problem.Cost(initial, result.inlier_a_in_b, result.inlier_b_in_a);
  result.final_cost = problem.Cost(t, result.inlier_a_in_b, result.inlier_b_in_a);
  Vector7d g;
  problem.Normal(t, result.inlier_a_in_b, result.inlier_b_in_a, &result.information, &g);
  result.median_error_px = MedianError(observations, t, result);
  const Eigen::LDLT<Matrix7d> ldlt(result.information);
  result.success = ldlt.isPositive() && ldlt.vectorD().minCoeff() > 1e-15 * ldlt.vectorD().maxCoeff();
  return result;
}

}  // namespace mapmend
