#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"

namespace mapmend {

struct PnpOptions {
  double threshold_px = 4.0;  // of an inlier, at sigma 1
  int max_iterations = 300;
  double confidence = 0.999;
  uint64_t seed = 1;

  // Not visited: seed: that of the whole program.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("threshold_px", threshold_px, MoreThan(0), "pixels at sigma 1");
    v("max_iterations", max_iterations, Range(1, 1e6));
    v("confidence", confidence, Between(0, 1));
  }
};

struct PnpResult {
  bool success = false;
  Rigid3 cam_from_world;
  std::vector<uint8_t> inlier;  // per correspondence
  int num_inliers = 0;
};

// Pose of a calibrated camera from points and their pixels, with gross outliers: P3P in a seeded RANSAC (Fischler and
// Bolles 1981). sigmas scale the threshold per correspondence. The pose is that of the best sample: refine it
// (OptimizePose).
PnpResult SolvePnpRansac(const Pinhole& camera, const std::vector<Eigen::Vector3d>& points,
                         const std::vector<Eigen::Vector2d>& pixels, const std::vector<double>& sigmas,
                         const PnpOptions& options);

}  // namespace mapmend
