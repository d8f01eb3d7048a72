#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "libs/geometry/rigid3.h"
#include "libs/optim/calibration_cost.h"

namespace mapmend {

// Derivatives of one observation's residual, already weighted.
struct CalibrationRow {
  int pose = -1, point = -1;
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> by_pose;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
  Eigen::Matrix<double, 2, kNumIntrinsics, Eigen::RowMajor> by_intrinsics;

  void Scale(double factor) {
    by_pose *= factor;
    by_point *= factor;
    by_intrinsics *= factor;
  }
};

// The normal equations of a calibration at its solution, with points eliminated (Schur complement). Pose 0 and the
// distance to the pose farthest from it are held, so that only what the images leave open is open. Unknowns, in order:
// steps of the poses (6 each), intrinsics, points (3 each).
class CalibrationLinearisation {
 public:
  CalibrationLinearisation(const std::vector<Rigid3>& poses, size_t num_points);
  void Add(const CalibrationRow& row) { rows_.push_back(row); }

  // Of the intrinsics, for residuals of variance 1. Nothing if the equations are singular.
  std::optional<Eigen::Matrix<double, kNumIntrinsics, kNumIntrinsics>> Covariance() const;
  // How all unknowns follow when the factor of the focal length is one larger. To be called after Covariance, if that
  // has given something.
  Eigen::VectorXd Direction() const;

 private:
  size_t num_poses_, num_points_;
  Eigen::VectorXd scale_gradient_;  // of the distance that is held, by the poses' steps
  std::vector<CalibrationRow> rows_;
  mutable Eigen::VectorXd direction_;
};

}  // namespace mapmend
