#pragma once

#include <deque>
#include <limits>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/chi_square.h"
#include "procs/frontend/beginning_proof.h"
#include "procs/frontend/beginning_window.h"
#include "procs/frontend/initialization.h"

namespace mapmend {

struct InitializerOptions {
  int max_buffered_frames = 300;  // frames kept since the loss
  int min_matches = 60;
  int min_points = 50;
  double min_median_angle_deg = 1.5;  // between the rays to the points
  double min_motion = 0.02;           // median shift of matches, of the image width: less is not worth a trial
  double ambiguity_ratio =
      0.8;  // a second, different motion that explains this share of the best one's matches is a rival
  // The best one's squared errors, in all frames of the window, must be below this share of each rival's, else:
  // ambiguous. That alone proves nothing (BeginningProof).
  double max_misfit_ratio = 0.8;
  double max_sigma = kChi2Dof95;  // reprojection error of an inlier, in sigma of its octave
  WindowOptions window;
  BeginningProofOptions proof;
  // Time between frames that are tried, once one was refused for want of parallax: seconds, or a share of the time that
  // the frames have waited, if that is more. Earlier the parallax would hardly have grown.
  double min_retry_s = 0.1;
  double min_retry_share = 0.1;
  uint64_t seed = 1;

  // Not visited: seed: that of the whole program.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_buffered_frames", max_buffered_frames, Range(2, 1e6), "frames");
    v("min_matches", min_matches, Range(8, 100000));
    v("min_points", min_points, Range(8, 100000), "points");
    v("min_median_angle_deg", min_median_angle_deg, Range(0, 90), "degrees");
    v("min_motion", min_motion, Range(0, 1), "of the image width");
    v("ambiguity_ratio", ambiguity_ratio, Range(0, 1), "of the matches");
    v("max_misfit_ratio", max_misfit_ratio, Range(0, 1));
    v("max_sigma", max_sigma, MoreThan(0), "sigma");
    v("window", window);
    v("proof", proof);
    v("min_retry_s", min_retry_s, AtLeast(0), "s");
    v("min_retry_share", min_retry_share, Range(0, 10), "of the time waited");
  }
};

// Starts a submap from two views of the same ground and up to three frames in between. Frames since the loss are kept;
// each new one is tried against the oldest that still shares enough features, among the newest sixty and then among
// all. All decompositions of a homography (planar scenes, nadir views) and of an essential matrix compete: each is
// refined by bundle adjustment on all matches of the two views, then those that explain nearly as much as the best one
// with the frames in between. If two that truly differ explain these nearly as well, the pair is refused as ambiguous;
// else BeginningProof decides whether it is believed, or waits for more parallax.
class Initializer {
 public:
  Initializer(const InitializerOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options), camera_(camera), pyramid_(pyramid), proof_(options.proof, camera, pyramid) {}

  Initialization AddFrame(const FramePtr& frame);
  void Clear() {
    frames_.clear();
    refused_utime_ = kNever;
    proof_.Clear();
  }
  // Frames since the loss, oldest first.
  const std::deque<FramePtr>& Frames() const { return frames_; }
  // Forgets all frames before this one.
  void DropBefore(const FramePtr& frame);

 private:
  Initialization TryPartners(const FramePtr& frame, int oldest, int newest) const;  // indices of frames_
  int64_t RetryInterval() const;
  Initialization Try(const FramePtr& first, const FramePtr& second, const std::vector<FramePtr>& between) const;
  LossReason Prove(const BeginningWindow& window, const std::vector<TwoViewCandidate>& candidates,
                   WindowAdjustment* winner) const;
  void TakeMap(const BeginningWindow& window, const WindowAdjustment& adjusted, Initialization* result) const;
  InitializerOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
  BeginningProof proof_;
  std::deque<FramePtr> frames_;
  static constexpr int64_t kNever = std::numeric_limits<int64_t>::min() / 2;
  int64_t refused_utime_ = kNever;  // of the last frame that was refused though it shares enough
  LossReason refused_reason_ = LossReason::kNone, refused_cause_ = LossReason::kNone;
};

}  // namespace mapmend
