#pragma once

#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/chi_square.h"
#include "procs/frontend/frame.h"
#include "procs/frontend/two_view_candidates.h"

namespace mapmend {

struct PhotoPairOptions {
  // That a motion between the two must explain; the map of a beginning needs as many as with ORB, all the same.
  int min_points = 30;
  double min_median_angle_deg = 1.5;  // between the rays to them
  double max_sigma = kChi2Dof95;      // reprojection error of what is explained, in sigma of its octave
  MotionRankingOptions ranking;
  // What a third photo, or the map, must tell of the same points:
  int min_common = 8;              // points whose depths agree ...
  double max_depth_spread = 0.05;  // ... to this share of the depth, up to one scale ...
  double min_agreeing = 0.6;       // ... and their share of all that are common
  double max_rival = 0.5;          // share of theirs that may agree with another motion
  uint64_t seed = 1;

  // Not visited: seed: that of the whole program.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_points", min_points, Range(8, 100000), "points");
    v("min_median_angle_deg", min_median_angle_deg, Range(0, 90), "degrees");
    v("max_sigma", max_sigma, MoreThan(0), "sigma");
    v("ranking", ranking);
    v("min_common", min_common, Range(3, 100000), "points");
    v("max_depth_spread", max_depth_spread, Range(0, 1), "of the depth");
    v("min_agreeing", min_agreeing, Range(0, 1), "of the points");
    v("max_rival", max_rival, Range(0, 1), "of the points");
  }
};

// Two photos and the motions that may be the one between them. Seen from above the ground is a plane, and two motions
// explain a plane equally well; which one is true, depths of the same points from elsewhere tell.
struct PhotoPair {
  FramePtr first, second;
  std::vector<Match> found;
  std::vector<TwoViewCandidate> motions;  // those that explain most first
};

// The matches of two photos, and the motions that explain enough of them.
PhotoPair PairOf(const FramePtr& first, const FramePtr& second, const PhotoPairOptions& options, const Pinhole& camera,
                 const Pyramid& pyramid);

// Depth of each feature of a photo, in any unit; 0: unknown.
using Depths = std::vector<double>;

Depths DepthsInFirst(const PhotoPair& pair, const TwoViewCandidate& motion);
Depths DepthsInSecond(const PhotoPair& pair, const TwoViewCandidate& motion);

// How depths of the same photo from two sources go together.
struct DepthAgreement {
  double scale = 0;  // of the first over the second, median
  int num_common = 0, num_agreeing = 0;
};
DepthAgreement Compare(const Depths& depths, const Depths& others, double max_spread);

// The motion with which most depths agree.
class MotionVote {
 public:
  explicit MotionVote(const PhotoPairOptions& options) : options_(options) {}
  void Add(const TwoViewCandidate& motion, const DepthAgreement& agreement);
  // Enough agree with one.
  bool HasWinner() const { return agreement_.num_agreeing >= options_.min_common; }
  // And clearly fewer with any other.
  bool IsClear() const { return HasWinner() && num_rival_ <= options_.max_rival * agreement_.num_agreeing; }
  const TwoViewCandidate& Winner() const { return *winner_; }
  double Scale() const { return agreement_.scale; }

 private:
  PhotoPairOptions options_;
  const TwoViewCandidate* winner_ = nullptr;
  DepthAgreement agreement_;
  int num_rival_ = 0;
};

}  // namespace mapmend
