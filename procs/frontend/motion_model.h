#pragma once

#include <cstdint>
#include <optional>

#include "libs/base/range.h"
#include "libs/geometry/rigid3.h"
#include "procs/frontend/frame.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

struct MotionModelOptions {
  double max_time_ratio = 2.5;  // time ahead, of the time between the last two frames: no prediction beyond it
  double max_jump = 0.15;       // a step of this share of the scene's depth ...
  double max_jump_ratio = 5;    // ... and so many times the last step is a jump
  double gap_ratio = 5;         // time since the last frame, of the usual time between frames: images are missing

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_time_ratio", max_time_ratio, Range(0, 100));
    v("max_jump", max_jump, Range(0, 100));
    v("max_jump_ratio", max_jump_ratio, Range(1, 1000));
    v("gap_ratio", gap_ratio, Range(1, 10000));
  }
};

// Where the camera will be if it goes on as between the last two frames: constant velocity and turn.
class MotionModel {
 public:
  explicit MotionModel(const MotionModelOptions& options) : options_(options) {}

  // A frame that was tracked.
  //   keyframe  that it has become; none: it is no keyframe
  //   follows   it came right after the last one; else nothing is known of the motion between the two
  void Add(const FramePtr& frame, const Rigid3& cam_from_submap, KeyframeIndex keyframe, bool follows);
  // Before Predict and IsJump: keyframes among the last two have the poses that bundle adjustment has given them since.
  void Refresh(const WorkingMap& map);
  void Clear() { last_ = before_last_ = {}; }

  // The last frame that was tracked; null: none since Clear.
  const FramePtr& Last() const { return last_.frame; }
  // cam_from_submap at that time; none if too little is known or the time lies too far ahead.
  std::optional<Rigid3> Predict(int64_t utime) const;
  // Whether a frame that Predict knew of lies implausibly far from the last one.
  //   depth  median of the points that the frame sees
  bool IsJump(const Rigid3& cam_from_submap, double depth) const;
  // Whether images are missing before this time.
  bool IsAfterGap(int64_t utime) const;

 private:
  struct Place {
    FramePtr frame;
    Rigid3 cam_from_submap;
    KeyframeIndex keyframe;
  };

  MotionModelOptions options_;
  Place last_, before_last_;  // in the submap that is tracked
};

}  // namespace mapmend
