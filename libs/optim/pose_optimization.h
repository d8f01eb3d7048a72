#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/chi_square.h"
#include "libs/geometry/rigid3.h"

namespace mapmend {

struct PoseObservation {
  Eigen::Vector3d point;  // world frame
  Eigen::Vector2d pixel;
  double sigma = 1.0;  // pixels
};

struct PoseOptimizationOptions {
  int rounds = 4;  // outliers are judged anew after each
  int iterations_per_round = 10;
  double huber = kChi2Dof95;               // in sigma; off in the last two rounds
  double outlier_chi2 = kChiSquare2Dof95;  // in sigma^2

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("rounds", rounds, Range(1, 1000));
    v("iterations_per_round", iterations_per_round, Range(1, 1000));
    v("huber", huber, AtLeast(0), "sigma");
    v("outlier_chi2", outlier_chi2, MoreThan(0), "sigma^2");
  }
};

struct PoseOptimizationResult {
  bool success = false;  // at least 6 inliers and a well-conditioned solution
  Rigid3 cam_from_world;
  std::vector<uint8_t> inlier;
  int num_inliers = 0;
  double median_chi2 = 0;  // of the inliers
};

// Robust camera pose for fixed points: Levenberg-Marquardt on reprojection errors with analytic Jacobians, Huber loss,
// and alternating rejection of outliers, as is usual in feature-based tracking (Mur-Artal and Tardos, T-RO 2015, sec.
// V).
PoseOptimizationResult OptimizePose(const Pinhole& camera, const Rigid3& initial_cam_from_world,
                                    const std::vector<PoseObservation>& observations,
                                    const PoseOptimizationOptions& options);

}  // namespace mapmend
