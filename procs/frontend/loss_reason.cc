#include "procs/frontend/loss_reason.h"

namespace mapmend {

std::string ToString(LossReason reason) {
  switch (reason) {
    case LossReason::kNone:
      return "";
    case LossReason::kDarkness:
      return "darkness";
    case LossReason::kBlur:
      return "blur";
    case LossReason::kSmallImages:
      return "small_images";
    case LossReason::kInputGap:
      return "input_gap";
    case LossReason::kTooFewFeatures:
      return "too_few_features";
    case LossReason::kTooFewMatches:
      return "too_few_matches";
    case LossReason::kNoCommonMotion:
      return "no_common_motion";
    case LossReason::kNoMotion:
      return "no_motion";
    case LossReason::kNoParallax:
      return "no_parallax";
    case LossReason::kAmbiguous:
      return "ambiguous";
    case LossReason::kNotConfirmed:
      return "not_confirmed";
    case LossReason::kTooFewInliers:
      return "too_few_inliers";
    case LossReason::kUnsupportedPose:
      return "unsupported_pose";
    case LossReason::kInconsistentMotion:
      return "inconsistent_motion";
    case LossReason::kEndOfInput:
      return "end_of_input";
  }
  return "";
}

std::string ToString(TrackMethod method) {
  switch (method) {
    case TrackMethod::kNone:
      return "";
    case TrackMethod::kInitialised:
      return "initialised";
    case TrackMethod::kMotion:
      return "motion";
    case TrackMethod::kWide:
      return "wide";
    case TrackMethod::kDescriptors:
      return "descriptors";
    case TrackMethod::kPair:
      return "pair";
  }
  return "";
}

}  // namespace mapmend
