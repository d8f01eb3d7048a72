#pragma once

#include "libs/base/range.h"
#include "procs/frontend/frame.h"
#include "procs/frontend/initializer.h"
#include "procs/frontend/loss_reason.h"
#include "procs/frontend/motion_model.h"

namespace mapmend {

struct LossDiagnosisOptions {
  double dark = 12;       // mean grey level below which an image is dark
  double blurred = 0.4;   // sharpness, of the last good frame's, below which an image is blurred
  double unsharp = 3;     // the same without a good frame before: mean absolute Laplacian, grey levels
  int small_image = 200;  // pixels: poses from narrower images are too uncertain to be believed
  int min_features = 60;  // fewer: nothing could be matched

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("dark", dark, Range(0, 255), "grey levels");
    v("blurred", blurred, Range(0, 1));
    v("unsharp", unsharp, Range(0, 255), "grey levels");
    v("small_image", small_image, Range(0, 100000), "pixels");
    v("min_features", min_features, Range(0, 100000));
  }
};

// Why a frame has no pose. What is wrong with the image itself comes before what is wrong between images.
class LossDiagnosis {
 public:
  LossDiagnosis(const LossDiagnosisOptions& options, int image_width) : options_(options), image_width_(image_width) {}

  // Of a frame that began no submap.
  LossReason OfBeginning(const Frame& frame, LossReason cause) const;
  // Of a frame that was not tracked. motion: with the last frame that was.
  LossReason OfTracking(const Frame& frame, const MotionModel& motion, LossReason tracker_reason) const;
  // Of a submap that was given up because this became of its next frame.
  LossReason OfGivingUp(LossReason cause) const { return IsSmall() ? LossReason::kSmallImages : cause; }

 private:
  bool IsSmall() const { return image_width_ < options_.small_image; }

  LossDiagnosisOptions options_;
  int image_width_;
};

}  // namespace mapmend
