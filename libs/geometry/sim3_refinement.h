#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/chi_square.h"
#include "libs/geometry/sim3_correspondence.h"

namespace mapmend {

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

// Small change of a similarity b_from_a, in the frame of b: d = (omega, upsilon, lambda),
//   rotation' = exp(omega) rotation,  scale' = exp(lambda) scale,  translation' = translation + upsilon.
// Rotation and scale turn about the image of a's origin, so upsilon is plainly how far that image moves.
Similarity3 Perturb(const Similarity3& b_from_a, const Vector7d& d);
// The d with Perturb(from, d) = to.
Vector7d Difference(const Similarity3& from, const Similarity3& to);

// Derivative of where b_from_a puts a point, by d.
Eigen::Matrix<double, 3, 7> PlaceJacobian(const Similarity3& b_from_a, const Eigen::Vector3d& point_in_a);

// Residual (predicted - seen) / sigma of a point of a seen in b, and its derivative by d. False behind the camera.
bool ResidualAInB(const CrossObservation& o, const Similarity3& b_from_a, Eigen::Vector2d* residual,
                  Eigen::Matrix<double, 2, 7>* jacobian);
// The same for a point of b seen in a; still by the d of b_from_a.
bool ResidualBInA(const CrossObservation& o, const Similarity3& b_from_a, Eigen::Vector2d* residual,
                  Eigen::Matrix<double, 2, 7>* jacobian);

struct Sim3RefinementOptions {
  int max_iterations = 20;
  double huber = 2.0;  // sigma; errors beyond it count linearly
  // sigma^2; observations beyond it are dropped after the first round, and counted out.
  double max_squared_error = kChiSquare2Dof99;
  int num_rounds = 3;  // refine, drop, refine ...; dropped ones may come back

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_iterations", max_iterations, Range(1, 10000));
    v("huber", huber, MoreThan(0), "sigma");
    v("max_squared_error", max_squared_error, MoreThan(0), "sigma^2");
    v("num_rounds", num_rounds, Range(1, 1000));
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

struct Sim3RefinementResult {
  bool success = false;  // converged on at least four observations that determine all seven parameters
  Similarity3 b_from_a;
  Matrix7d information;  // J^T W J at the end, by d: inverse covariance if sigmas are right
  std::vector<char> inlier_a_in_b, inlier_b_in_a;
  int num_inliers = 0;
  double median_error_px = 0;               // of the inliers
  double initial_cost = 0, final_cost = 0;  // robust, of the inliers, before and after
};

// Least-squares similarity on the reprojection errors both ways, Huber loss, Levenberg-Marquardt with analytic
// Jacobians.
Sim3RefinementResult RefineSim3(const CrossObservations& observations, const Similarity3& initial,
                                const Sim3RefinementOptions& options);

}  // namespace mapmend
