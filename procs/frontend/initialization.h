#pragma once

#include <vector>

#include "libs/geometry/rigid3.h"
#include "procs/frontend/frame.h"
#include "procs/frontend/loss_reason.h"

namespace mapmend {

struct InitialPoint {
  int first_feature = -1, second_feature = -1;
  Eigen::Vector3d position;  // in the frame of the first camera; median depth 1
};

// A frame between the two views that took part.
struct InitialView {
  FramePtr frame;
  Rigid3 from_first;
  std::vector<int> features;  // per initial point, -1: not seen
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
  std::vector<InitialView> between;
  double median_angle_deg = 0;  // between the rays to the points
  double shape_sigma = 0;       // of the cameras' path, of its extent
  bool is_plausible = false;    // it fits; whether it is believed is another question
  bool is_uncertain = false;    // believed only because nothing better came
};

}  // namespace mapmend
