#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libs/geometry/similarity3.h"

namespace mapmend {

// A camera centre of the map and where a receiver says that it was.
struct PositionPair {
  int64_t utime = 0;  // of the camera's clock
  size_t fix = 0;     // index into the fixes
  Eigen::Vector3d map = Eigen::Vector3d::Zero();
  Eigen::Vector3d enu = Eigen::Vector3d::Zero();    // metres
  double sigma_horizontal = 1, sigma_vertical = 1;  // metres
};

// What is known of the rotation besides.
struct RotationHint {
  Eigen::Quaterniond enu_from_map = Eigen::Quaterniond::Identity();
  double sigma_rad = 1;  // about every axis
};

using Matrix7 = Eigen::Matrix<double, 7, 7>;

struct SimilarityFit {
  bool success = false;
  Similarity3 enu_from_map;
  std::vector<double> weights;  // per pair, 0 to 1; below a quarter: an outlier
  double spread = 1;            // residuals in standard deviations that were told: 1 if these are right
  double cost = 0;              // mean robust squared residual, in told standard deviations
  // Of translation (east, north, up; metres, at `center`), rotation (radians about these axes) and log of the scale, if
  // the errors of the fixes were independent, and as large as the residuals show.
  Matrix7 covariance = Matrix7::Zero();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // of the pairs, ENU
};

// Residual in standard deviations of the pair.
Eigen::Vector3d WhitenedResidual(const PositionPair& pair, const Similarity3& enu_from_map);

// The similarity that fits most pairs: sampling of three at a time (RANSAC; Fischler and Bolles 1981) for a first
// guess, then iteratively reweighted least squares with Cauchy's weights, which let go of what does not fit.
// Deterministic. Needs three pairs.
//   guess  used instead of sampling
SimilarityFit FitSimilarity(const std::vector<PositionPair>& pairs, const std::optional<RotationHint>& hint,
                            const std::optional<Similarity3>& guess = std::nullopt);

// Least squares, without regard to outliers; nullopt if that is not possible.
std::optional<Similarity3> LeastSquaresSimilarity(const std::vector<PositionPair>& pairs);

}  // namespace mapmend
