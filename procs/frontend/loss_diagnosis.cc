#include "procs/frontend/loss_diagnosis.h"

namespace mapmend {

LossReason LossDiagnosis::OfBeginning(const Frame& frame, LossReason cause) const {
  if (frame.mean_brightness < options_.dark) return LossReason::kDarkness;
  if (IsSmall()) return LossReason::kSmallImages;
  if (static_cast<int>(frame.features.Size()) < options_.min_features) return LossReason::kTooFewFeatures;
  if (frame.sharpness < options_.unsharp) return LossReason::kBlur;
  return cause;
}

LossReason LossDiagnosis::OfTracking(const Frame& frame, const MotionModel& motion, LossReason tracker_reason) const {
  if (frame.mean_brightness < options_.dark) return LossReason::kDarkness;
  if (frame.sharpness < options_.blurred * motion.Last()->sharpness) return LossReason::kBlur;
  if (motion.IsAfterGap(frame.utime)) return LossReason::kInputGap;
  return tracker_reason;
}

}  // namespace mapmend
