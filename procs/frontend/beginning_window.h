#pragma once

#include <cstdint>
#include <vector>

#include "libs/base/range.h"
#include "libs/features/matching.h"
#include "libs/geometry/camera.h"
#include "procs/frontend/frame.h"

namespace mapmend {

// A motion between two views and what it explains.
struct TwoViewCandidate {
  Rigid3 second_from_first;                         // |translation| = 1
  std::vector<int> matches, far_matches;            // indices of the matches that it explains, with and without a depth
  std::vector<Eigen::Vector3d> points, far_points;  // of these, in the frame of the first camera
  double median_angle_deg = 0;                      // between the rays to the points
  size_t Support() const { return matches.size() + far_matches.size(); }
};

// The frames in which a beginning proves itself: a first one, others after it, and what they have in common with it.
struct BeginningWindow {
  struct Other {
    FramePtr frame;
    std::vector<Match> matches;  // a: feature of the first frame, b: of this one
  };
  FramePtr first;
  std::vector<Other> others;  // at least one, ascending in time; the last one is the second view of the candidates
};

// Matches the frames in between with those features of the first one that the second has as well.
BeginningWindow MakeBeginningWindow(const FramePtr& first, const FramePtr& second, const std::vector<Match>& matches,
                                    const std::vector<FramePtr>& between);

// What a motion between two views becomes when all frames of the window are adjusted with it.
struct WindowAdjustment {
  bool success = false;
  std::vector<Rigid3> other_from_first;  // per other frame
  std::vector<uint8_t> has_pose;         // per other frame: enough of the points were found in it
  std::vector<int> features;             // of the first frame, that have a point ...
  std::vector<Eigen::Vector3d> points;   // ... in the frame of the first camera; scaled with the poses
  // Sum over all matches of all frames of the squared errors in sigma, each cut off at max_sigma squared: half of it is
  // the negative logarithm of the likelihood. Matches without a point count as cut off.
  double misfit = 0;
  // RelativeShapeSigma, with the noise that the images show where that is more than was assumed.
  double shape_sigma = 0;
};

struct WindowOptions {
  double max_sigma = 2.4477;  // reprojection error of an inlier, in sigma of its octave
  int points_per_pose = 150;  // that determine a pose in bundle adjustment; the other points follow
  int max_iterations = 15;    // of bundle adjustment, in each round
  int rounds = 3;             // what does not fit is left out anew in each
  int min_points = 15;        // that a frame in between must show to take part
  uint64_t seed = 1;

  // Not visited: max_sigma, seed: those of the initializer.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("points_per_pose", points_per_pose, Range(3, 1e6), "points");
    v("max_iterations", max_iterations, Range(1, 1000));
    v("rounds", rounds, Range(1, 100));
    v("min_points", min_points, Range(4, 1e6), "points");
  }
};

WindowAdjustment AdjustWindow(const WindowOptions& options, const Pinhole& camera, const Pyramid& pyramid,
                              const BeginningWindow& window, const TwoViewCandidate& candidate);

}  // namespace mapmend
