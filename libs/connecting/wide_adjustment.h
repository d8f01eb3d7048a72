#pragma once

#include <Eigen/Core>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/sim3_refinement.h"

namespace mapmend {

// Where something is seen in a frame of known pose.
struct WideSighting {
  Rigid3 cam_from_submap;
  Pinhole camera;
  Eigen::Vector2d pixel;
  double sigma = 1;  // pixels
};

// Something that both submaps see; in each at least once.
struct WideCommonTrack {
  std::vector<WideSighting> in_a, in_b;
};

struct WideAdjustmentOptions {
  int max_iterations = 20;
  double huber = 2;                 // sigma; errors beyond it count linearly
  double max_squared_error = 9.21;  // sigma^2, of the worst sighting: else the track is none of the inliers

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_iterations", max_iterations, Range(1, 1000));
    v("huber", huber, MoreThan(0), "sigma");
    v("max_squared_error", max_squared_error, MoreThan(0), "sigma^2");
  }
};

struct WideAdjustmentResult {
  bool success = false;  // the tracks determine all seven parameters
  Similarity3 b_from_a;
  Matrix7d information =
      Matrix7d::Zero();         // by the d of Perturb, of the inliers; less where errors are larger than their sigmas
  std::vector<char> is_inlier;  // per track
  std::vector<Eigen::Vector4d> points;  // homogeneous, frame of a; per track
  int num_inliers = 0;
  double median_error_px = 0;  // of the inliers' sightings in b
};

// The similarity between two submaps whose frames stay as they are, and the places of what both see, by least squares
// on all sightings of both sides. A place is a direction and an inverse depth, so that what is too far away for a depth
// counts for the rotation and takes no false depth; one that each side sees once counts as its distance from the
// epipolar line. Levenberg-Marquardt, places eliminated (Schur complement), Huber loss.
//   use  per track: whether it takes part; is_inlier is told of all
WideAdjustmentResult AdjustWide(const std::vector<WideCommonTrack>& tracks, const std::vector<char>& use,
                                const Similarity3& initial, const WideAdjustmentOptions& options);

}  // namespace mapmend
