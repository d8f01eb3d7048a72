#pragma once

#include <cstdint>
#include <vector>

#include "libs/base/range.h"
#include "libs/features/features.h"
#include "libs/features/matching.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"

namespace mapmend {

struct MotionRankingOptions {
  double proposal_error_px = 1.5;     // of a match that a proposed motion explains
  double unrefined_sigma_factor = 2;  // of max_sigma: a motion proposed from a few matches is rough
  double min_refined_share = 0.5;     // of what the best one explains: what explains less would not win if refined

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("proposal_error_px", proposal_error_px, MoreThan(0), "pixels");
    v("unrefined_sigma_factor", unrefined_sigma_factor, AtLeast(1));
    v("min_refined_share", min_refined_share, Range(0, 1), "of the matches");
  }
};

// A motion between two views and what it explains.
struct TwoViewCandidate {
  Rigid3 second_from_first;                         // |translation| = 1
  std::vector<int> matches, far_matches;            // indices of the matches that it explains, with and without a depth
  std::vector<Eigen::Vector3d> points, far_points;  // of these, in the frame of the first camera
  double median_angle_deg = 0;                      // between the rays to the points
  size_t Support() const { return matches.size() + far_matches.size(); }
};

// Where both views see what was matched; all of the same length.
struct MatchedPixels {
  std::vector<Eigen::Vector2d> first, second;  // pixels
  std::vector<double> sigma_first, sigma_second;
  std::vector<Eigen::Vector2d> ray_first, ray_second;  // x and y of rays with z = 1
};

MatchedPixels PixelsOf(const std::vector<Match>& matches, const Features& first, const Features& second,
                       const Pinhole& camera, const Pyramid& pyramid);

// Median shift of the matches between the two images, pixels. There must be a match.
double MedianShift(const MatchedPixels& matches);

// The truly different motions that may be the one between the two views, refined, those that explain most matches
// first.
//   max_sigma  reprojection error of a match that is explained, in sigma of its octave
std::vector<TwoViewCandidate> RankMotions(const MotionRankingOptions& options, const Pinhole& camera,
                                          const MatchedPixels& matches, double max_sigma, uint64_t seed);

}  // namespace mapmend
