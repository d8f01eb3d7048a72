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

void MotionModel::Add(const FramePtr& frame, bool follows) {
  before_last_ = follows ? last_ : nullptr;
  last_ = frame;
}

std::optional<Rigid3> MotionModel::Predict(int64_t utime) const {
  if (!last_ || !before_last_) return std::nullopt;
  const double dt = static_cast<double>(last_->utime - before_last_->utime);
  const double ahead = static_cast<double>(utime - last_->utime);
  if (dt <= 0 || ahead <= 0 || ahead > options_.max_time_ratio * dt) return std::nullopt;
  return Extrapolate(before_last_->cam_from_submap, last_->cam_from_submap, ahead / dt);
}

bool MotionModel::IsJump(const Frame& frame, double depth) const {
  const Eigen::Vector3d last = last_->cam_from_submap.Center();
  const double step = (frame.cam_from_submap.Center() - last).norm();
  const double last_step = (last - before_last_->cam_from_submap.Center()).norm();
  return step > options_.max_jump_ratio * last_step && step > options_.max_jump * depth;
}

bool MotionModel::IsAfterGap(int64_t utime) const {
  return before_last_ && static_cast<double>(utime - last_->utime) >
                             options_.gap_ratio * static_cast<double>(last_->utime - before_last_->utime);
}

}  // namespace mapmend
