#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/connected_frames.h"
#include "libs/connecting/wide_registration.h"

namespace mapmend {

struct WideConnectionOptions {
  WideTrackOptions tracks;
  WideRegistrationOptions registration;
  // Acceptance.
  int min_inliers = 25;       // tracks that both sides see, with a point on one side at least
  double min_evidence = 120;  // nats, of what looked alike before anything was searched; chance with 7 free parameters
                              // and thousands of samples comes to some 60
  double max_rival = 0.6;     // evidence for another transform, as a share of it: repeated facades offer several
  // Of an 8 x 6 grid, occupied by inliers, in the frame of each side that holds most of them: of the nearer side, and
  // of the farther one, which sees the same in a small part of its image.
  int min_cells = 6, min_cells_far = 3;
  int min_frames = 3;  // of each side, with min_in_frame inliers each; all, if there are fewer
  int min_in_frame = 6;
  int min_pairs = 3;                 // of keyframes that have so many inliers in common
  double min_match_rate = 0.06;      // of the points that should be seen, found by guided search
  double max_position_sigma = 0.05;  // of a camera across the gap, of its viewing distance
  double max_scale_sigma = 0.1;      // of the scale, as a share of it
  double max_speed = 4;              // across the gap, times the largest of both sides: what moves does not jump
  double max_median_error = 3;       // pixels

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("tracks", tracks);
    v("registration", registration);
    v("min_inliers", min_inliers, Range(7, 1e6), "tracks");
    v("min_evidence", min_evidence, AtLeast(0), "nats");
    v("max_rival", max_rival, Range(0, 1));
    v("min_cells", min_cells, Range(0, 48), "cells");
    v("min_cells_far", min_cells_far, Range(0, 48), "cells");
    v("min_frames", min_frames, Range(1, 1000), "frames");
    v("min_in_frame", min_in_frame, Range(1, 1e6), "inliers");
    v("min_match_rate", min_match_rate, Range(0, 1));
    v("min_pairs", min_pairs, Range(1, 1000));
    v("max_position_sigma", max_position_sigma, MoreThan(0), "of the viewing distance");
    v("max_scale_sigma", max_scale_sigma, MoreThan(0));
    v("max_speed", max_speed, MoreThan(0));
    v("max_median_error", max_median_error, MoreThan(0), "pixels");
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// What one verification of two sides has given.
struct WideConnection {
  bool success = false;
  std::string reason;  // one sentence with numbers, for a person
  // Of success: pairs of keyframes, one per keyframe of b at most, the one of a with which it has most in common. All
  // have one transform. Else: one that says why.
  std::vector<ConnectedFrames> frames;
};

// Whether two sides are connected by wide features, and how. They must be of different submaps.
//   max_travel_s  time in which the camera got from the one to the other; negative: nothing is known of it
//   is_known      whether something else says so too: then it matters less what else might be. Null: nothing does
WideConnection VerifyWideConnection(const WideSide& a, const WideSide& b, double max_travel_s,
                                    const WideConnectionOptions& options,
                                    const std::function<bool(const Similarity3& b_from_a)>& is_known = {});

}  // namespace mapmend
