#pragma once

#include <string>

namespace mapmend {

// Why a frame has no pose, or why a submap ended.
enum class LossReason {
  kNone,
  kDarkness,
  kBlur,
  kSmallImages,
  kInputGap,
  kTooFewFeatures,
  kTooFewMatches,
  kNoCommonMotion,  // enough matches, but no motion of such a camera explains them
  kNoMotion,        // the image stands still
  kNoParallax,
  kAmbiguous,     // two different motions explain the images equally well
  kNotConfirmed,  // no map came of two frames that fit
  kTooFewInliers,
  kUnsupportedPose,
  kInconsistentMotion,
  kEndOfInput,
};

// How the pose of a frame was found.
enum class TrackMethod { kNone, kInitialised, kMotion, kWide, kDescriptors, kPair };

// The texts in records, events and logs; empty for kNone.
std::string ToString(LossReason reason);
std::string ToString(TrackMethod method);

}  // namespace mapmend
