#pragma once

#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/chi_square.h"
#include "procs/frontend/frame.h"
#include "procs/frontend/index.h"
#include "procs/frontend/two_view_candidates.h"

namespace mapmend {

struct PhotoPairOptions {
  int min_points = 30;                // that a motion between the two must explain
  double min_median_angle_deg = 1.5;  // between the rays to them
  double max_sigma = kChi2Dof95;      // reprojection error of what is explained, in sigma of its octave
  MotionRankingOptions ranking;
  // Of two photos and what a third tells of the same points:
  int min_common = 8;             // points that tell the scale
  double max_scale_spread = 0.05;  // of the ratio of their depths, from its median ...
  double min_agreeing = 0.6;      // ... for this share of them
  double max_rival = 0.5;         // of the agreeing points, for which another motion may agree as well
  uint64_t seed = 1;

  // Not visited: seed: that of the whole program.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_points", min_points, Range(8, 100000), "points");
    v("min_median_angle_deg", min_median_angle_deg, Range(0, 90), "degrees");
    v("max_sigma", max_sigma, MoreThan(0), "sigma");
    v("ranking", ranking);
    v("min_common", min_common, Range(3, 100000), "points");
    v("max_scale_spread", max_scale_spread, Range(0, 1), "of the depth");
    v("min_agreeing", min_agreeing, Range(0, 1), "of the points");
    v("max_rival", max_rival, Range(0, 1), "of the points");
  }
};

// Two photos and all motions that may be the one between them. Seen from above the ground is a plane, and a plane has
// two: what a third photo sees, or the map knows, of the same points tells which is true.
struct PhotoPair {
  FramePtr first, second;
  std::vector<Match> found;
  std::vector<TwoViewCandidate> motions;  // those that explain most first
};

PhotoPair PairOf(const FramePtr& first, const FramePtr& second, const PhotoPairOptions& options, const Pinhole& camera,
                 const Pyramid& pyramid);

// Depths of features of one photo by one motion of a pair; none: 0.
std::vector<double> DepthsInFirst(const PhotoPair& pair, const TwoViewCandidate& motion);
std::vector<double> DepthsInSecond(const PhotoPair& pair, const TwoViewCandidate& motion);

// How depths of the same features from two sources go together.
struct DepthAgreement {
  double scale = 0;  // of the first over the second, median
  int num_common = 0, num_agreeing = 0;
};
DepthAgreement Compare(const std::vector<double>& depths, const std::vector<double>& others, double max_spread);

}  // namespace mapmend
