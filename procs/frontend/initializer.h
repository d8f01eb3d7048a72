#pragma once

#include <deque>
#include <limits>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/chi_square.h"
#include "libs/stream/records.h"
#include "procs/frontend/frame.h"
#include "procs/frontend/index.h"
#include "procs/frontend/loss_reason.h"
#include "procs/frontend/two_view_candidates.h"

namespace mapmend {

struct InitializerOptions {
  int max_buffered_frames = 300;  // frames kept since the loss
  int min_matches = 60;
  int min_points = 50;
  double min_common_share = 0.5;      // of min_matches: a motion that explains fewer is none that they have in common
  double min_median_angle_deg = 1.5;  // between the rays to the points
  double min_motion = 0.02;           // median shift of matches, of the image width: less is not worth a trial
  double ambiguity_ratio =
      0.8;  // a second, different motion that explains this share of the best one's matches is a rival
  double max_misfit_ratio =
      0.67;  // the best one's squared errors must be below this share of each rival's, else: ambiguous
  double max_sigma = kChi2Dof95;  // reprojection error of an inlier, in sigma of its octave
  double min_retry_s = 0.1;       // time between frames that are tried, once one was refused for want of parallax
  MotionRankingOptions ranking;
  uint64_t seed = 1;

  // Not visited: seed: that of the whole program.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_buffered_frames", max_buffered_frames, Range(2, 1e6), "frames");
    v("min_matches", min_matches, Range(8, 100000));
    v("min_points", min_points, Range(8, 100000), "points");
    v("min_common_share", min_common_share, Range(0, 1), "of min_matches");
    v("min_median_angle_deg", min_median_angle_deg, Range(0, 90), "degrees");
    v("min_motion", min_motion, Range(0, 1), "of the image width");
    v("ambiguity_ratio", ambiguity_ratio, Range(0, 1), "of the matches");
    v("max_misfit_ratio", max_misfit_ratio, Range(0, 1));
    v("max_sigma", max_sigma, MoreThan(0), "sigma");
    v("min_retry_s", min_retry_s, AtLeast(0), "s");
    v("ranking", ranking);
  }
};

struct InitialPoint {
  FeatureIndex first_feature, second_feature;
  Eigen::Vector3d position;  // in the frame of the first camera; median depth 1
};

struct Initialization {
  bool success = false;
  LossReason reason = LossReason::kNone;  // if not: too_few_matches, no_parallax, ambiguous
  // Finer than the reason, for a person: too_few_matches may also be no_common_motion (enough matches, but no motion of
  // such a camera explains them), no_parallax may also be no_motion (the image stands still).
  LossReason cause = LossReason::kTooFewMatches;
  FramePtr first, second;
  Rigid3 second_from_first;
  std::vector<InitialPoint> points;
};

// Starts a submap from two views of the same ground. Frames since the loss are kept; each new one is tried against the
// oldest that still shares enough features, among the newest sixty and then among all. All decompositions of a
// homography (planar scenes, nadir views) and of an essential matrix compete: each is refined by bundle adjustment on
// all matches. If a second, truly different motion explains nearly as much as the best, up to three frames in between
// decide; if they cannot, the pair is refused as ambiguous.
class Initializer {
 public:
  Initializer(const InitializerOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options), camera_(camera), pyramid_(pyramid) {}

  Initialization AddFrame(const FramePtr& frame);
  // A beginning with these two frames, the first of which is kept; nothing comes of it with another.
  Initialization BeginWith(const FramePtr& first, const FramePtr& second) const;
  // Keeps a frame without trying it.
  void Keep(const FramePtr& frame);
  void Clear() {
    frames_.clear();
    refused_utime_ = kNever;
  }
  // Frames since the loss, oldest first.
  const std::deque<FramePtr>& Frames() const { return frames_; }
  // Forgets all frames before this one.
  void DropBefore(const FramePtr& frame);

 private:
  // Some frames between one that is kept and the next one.
  std::vector<FramePtr> Between(int first) const;
  Initialization TryPartners(const FramePtr& frame, int oldest, int newest) const;  // indices of frames_
  Initialization Try(const FramePtr& first, const FramePtr& second, const std::vector<FramePtr>& between) const;
  // Index of the candidate that is right; -1: two explain the images nearly equally well.
  int Decide(const Frame& first, const Frame& second, const std::vector<Match>& found,
             const std::vector<TwoViewCandidate>& candidates, const std::vector<FramePtr>& between) const;
  double Misfit(const Frame& first, const Frame& second, const std::vector<Match>& found,
                const TwoViewCandidate& candidate, const std::vector<FramePtr>& between) const;

  InitializerOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
  std::deque<FramePtr> frames_;
  static constexpr int64_t kNever = std::numeric_limits<int64_t>::min() / 2;
  int64_t refused_utime_ = kNever;  // of the last frame that was refused though it shares enough
  LossReason refused_reason_ = LossReason::kNone, refused_cause_ = LossReason::kNone;
};

}  // namespace mapmend
