#pragma once

#include <map>
#include <memory>
#include <vector>

#include "libs/base/random.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "procs/frontend/frame.h"

namespace mapmend {

// A scene of points with random descriptors, and exact views of it with pixel noise and flipped descriptor bits.
class SyntheticScene {
 public:
  // Points on the ground, x and y in [low, high], z in [-relief, relief]; the camera flies at z = -1 and looks down
  // (+z).
  SyntheticScene(int num_points, double low, double high, double relief, uint64_t seed) : random_(seed) {
    for (int i = 0; i < num_points; ++i) {
      points_.emplace_back(low + (high - low) * random_.Uniform(), low + (high - low) * random_.Uniform(),
                           relief * (2 * random_.Uniform() - 1));
      descriptors_.push_back({random_.Next(), random_.Next(), random_.Next(), random_.Next()});
    }
  }

  std::shared_ptr<Frame> View(const Rigid3& cam_from_world, int index, double noise_px = 0.3, int flipped_bits = 12) {
    auto frame = std::make_shared<Frame>();
    frame->index = index;
    shown_[index].clear();
    frame->utime = 1000000 * static_cast<int64_t>(index);
    frame->mean_brightness = 120;
    frame->sharpness = 10;
    for (size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d x = cam_from_world * points_[i];
      if (x.z() < 0.05) continue;
      Eigen::Vector2d pixel = camera_.Project(x);
      pixel += noise_px * Eigen::Vector2d(Gauss(), Gauss());
      if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= camera_.width || pixel.y() >= camera_.height) continue;
      Keypoint keypoint;
      keypoint.pixel = pixel.cast<float>();
      const Eigen::Vector3d north = cam_from_world.rotation * Eigen::Vector3d::UnitX();
      keypoint.angle = static_cast<float>(std::atan2(north.y(), north.x()));
      Descriptor descriptor = descriptors_[i];
      for (int b = 0; b < flipped_bits; ++b) descriptor[random_.Below(4)] ^= uint64_t{1} << random_.Below(64);
      shown_[index].push_back(static_cast<int>(i));
      frame->features.keypoints.push_back(keypoint);
      frame->features.descriptors.push_back(descriptor);
      frame->features.colors.push_back({100, 100, 100});
    }
    frame->grid = FeatureGrid(frame->features.keypoints, camera_.width, camera_.height);
    return frame;
  }

  const Pinhole& Camera() const { return camera_; }
  // The points that the last view with this index shows, one for each feature.
  std::vector<Eigen::Vector3d> Shown(int index) const {
    std::vector<Eigen::Vector3d> points;
    for (const int i : shown_.at(index)) points.push_back(points_[i]);
    return points;
  }

 private:
  double Gauss() {  // sum of uniforms: near enough, and the same everywhere
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += random_.Uniform();
    return sum;
  }

  Random random_;
  Pinhole camera_{480, 480, 400, 300, 800, 600};
  std::vector<Eigen::Vector3d> points_;
  std::vector<Descriptor> descriptors_;
  std::map<int, std::vector<int>> shown_;  // by index of the frame
};

// A camera at (x, y) one unit above the ground, looking straight down, its image's x axis turned by heading.
inline Rigid3 NadirPose(double x, double y, double heading = 0) {
  const Rigid3 world_from_cam(Eigen::Quaterniond(Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ())), {x, y, -1});
  return world_from_cam.Inverse();
}

}  // namespace mapmend
