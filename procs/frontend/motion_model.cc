#include "procs/frontend/motion_model.h"

namespace mapmend {
namespace {

// cam_from_submap after time_ratio times the motion from before to last.
Rigid3 Extrapolate(const Rigid3& before, const Rigid3& last, double time_ratio) {
  const Rigid3 motion = last * before.Inverse();
  const Eigen::Quaterniond turn = Eigen::Quaterniond::Identity().slerp(time_ratio, motion.rotation);
  return Rigid3(turn, time_ratio * motion.translation) * last;
}

}  // namespace

void MotionModel::Add(const FramePtr& frame, const Rigid3& cam_from_submap, KeyframeIndex keyframe, bool follows) {
  before_last_ = follows ? last_ : Place();
  last_ = {frame, cam_from_submap, keyframe};
}

void MotionModel::Refresh(const WorkingMap& map) {
  for (Place* place : {&before_last_, &last_}) {
    if (!place->keyframe.IsNone()) place->cam_from_submap = map.Keyframe(place->keyframe).cam_from_submap;
  }
}

std::optional<Rigid3> MotionModel::Predict(int64_t utime) const {
  if (!last_.frame || !before_last_.frame) return std::nullopt;
  const double dt = static_cast<double>(last_.frame->utime - before_last_.frame->utime);
  const double ahead = static_cast<double>(utime - last_.frame->utime);
  if (dt <= 0 || ahead <= 0 || ahead > options_.max_time_ratio * dt) return std::nullopt;
  return Extrapolate(before_last_.cam_from_submap, last_.cam_from_submap, ahead / dt);
}

bool MotionModel::IsJump(const Rigid3& cam_from_submap, double depth) const {
  const Eigen::Vector3d last = last_.cam_from_submap.Center();
  const double step = (cam_from_submap.Center() - last).norm();
  const double last_step = (last - before_last_.cam_from_submap.Center()).norm();
  return step > options_.max_jump_ratio * last_step && step > options_.max_jump * depth;
}

bool MotionModel::IsAfterGap(int64_t utime) const {
  if (!before_last_.frame) return false;
  const auto usual = static_cast<double>(last_.frame->utime - before_last_.frame->utime);
  return static_cast<double>(utime - last_.frame->utime) > options_.gap_ratio * usual;
}

}  // namespace mapmend
