#pragma once

#include <algorithm>
#include <memory>

#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {

// A survey of flat ground with photos that overlap by some 60 %: one sees 1.67 by 1.25 of it, the next one 0.65 farther
// on; and wind, which tilts the camera.
class SparseFlight {
 public:
  explicit SparseFlight(uint64_t seed) : scene_(60000, -2, 8, 0, seed), random_(seed) {}

  static constexpr double kStep = 0.65;

  Rigid3 Pose(double x, double y) {
    const auto tilt = [&] { return 0.2 * (random_.Uniform() - 0.5); };  // up to 6 degrees
    const Eigen::Quaterniond wind(Eigen::AngleAxisd(tilt(), Eigen::Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(tilt(), Eigen::Vector3d::UnitY()));
    return Rigid3(wind, Eigen::Vector3d::Zero()) * NadirPose(x, y);
  }
  // The photo with wide features.
  FramePtr Photo(const Rigid3& pose, int index) {
    const std::shared_ptr<Frame> frame = scene_.View(pose, index);
    const auto photo = std::make_shared<Frame>();
    photo->index = index;
    photo->utime = frame->utime;
    frame->photo = photo;
    return frame;
  }
  const Pinhole& Camera() const { return scene_.Camera(); }
  // The places of what the photo shows, one for each feature.
  std::vector<Eigen::Vector3d> Shown(int index) const { return scene_.Shown(index); }

 private:
  SyntheticScene scene_;
  Random random_;
};

}  // namespace mapmend
