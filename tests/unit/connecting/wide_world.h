#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "libs/base/random.h"
#include "libs/connecting/wide_tracks.h"

namespace mapmend::testing {

// A street as wide features see it: points with descriptors of their own, seen by a car that drives along z.
struct WidePoint {
  Eigen::Vector3d position;  // metres; y down, z along the street
  WideDescriptor descriptor;
  double size = 0.2;  // metres
};

inline double Gauss(Random* random) {
  return std::sqrt(-2 * std::log(std::max(1e-300, random->Uniform()))) * std::cos(2 * M_PI * random->Uniform());
}

inline WideDescriptor RandomDescriptor(Random* random) {
  std::array<double, 128> values;
  double sum = 0;
  for (double& v : values) sum += v = std::pow(random->Uniform(), 4);
  WideDescriptor d;
  for (size_t i = 0; i < d.size(); ++i) d[i] = static_cast<uint8_t>(std::min(127.0, 256 * std::sqrt(values[i] / sum)));
  return d;
}

// Two facades, 8 m to the left and to the right.
inline std::vector<WidePoint> MakeStreet(double from, double to, int count, Random* random) {
  std::vector<WidePoint> points;
  for (int i = 0; i < count; ++i) {
    WidePoint& p = points.emplace_back();
    p.position = {(random->Uniform() < 0.5 ? -8 : 8) + 0.5 * Gauss(random), -6 * random->Uniform() + 1.5,
                  from + (to - from) * random->Uniform()};
    p.size = 0.1 * std::pow(2, 3 * random->Uniform());
    p.descriptor = RandomDescriptor(random);
  }
  return points;
}

// The same facade again and again, every `period` metres.
inline std::vector<WidePoint> RepeatStreet(const std::vector<WidePoint>& one, double period, int times) {
  std::vector<WidePoint> points;
  for (int k = 0; k < times; ++k) {
    for (WidePoint p : one) {
      p.position.z() += k * period;
      points.push_back(p);
    }
  }
  return points;
}

inline Pinhole StreetCamera() { return {700, 700, 600, 190, 1200, 380}; }

// A camera at (x, 0, z) that looks along the street, turned by `yaw` radians.
inline Rigid3 StreetPose(double x, double z, double yaw) {
  const Eigen::Quaterniond world_from_cam(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()));
  return Rigid3(world_from_cam, {x, 0, z}).Inverse();
}

struct WideWorldOptions {
  double pixel_noise = 0.5;
  int num_clutter = 100;  // features of each image that are seen nowhere else
  double descriptor_noise = 2;
};

// One side: cam_from_world of each frame, and the frame and scale in which the submap is told.
inline WideSide SeeStreet(const std::vector<WidePoint>& points, const std::vector<Rigid3>& cameras,
                          const Similarity3& submap_from_world, double first_s, const WideWorldOptions& options,
                          Random* random, const Submap* submap) {
  const Pinhole camera = StreetCamera();
  std::vector<WideFrame> frames;
  for (size_t k = 0; k < cameras.size(); ++k) {
    auto features = std::make_shared<WideFeatures>();
    const auto add = [&](const Eigen::Vector2d& pixel, double size, const WideDescriptor& descriptor) {
      WideKeypoint keypoint;
      keypoint.pixel = pixel.cast<float>();
      keypoint.size = static_cast<uint8_t>(std::lround(WideKeypoint::kSizesPerOctave * std::log2(size)));
      features->keypoints.push_back(keypoint);
      features->descriptors.push_back(descriptor);
    };
    for (const WidePoint& p : points) {
      const Eigen::Vector3d x = cameras[k] * p.position;
      if (!(x.z() > 1)) continue;
      const double size = p.size * camera.fx / x.z();
      const Eigen::Vector2d noise(Gauss(random), Gauss(random));
      const Eigen::Vector2d pixel = camera.Project(x) + options.pixel_noise * std::max(1.0, size / 8) * noise;
      if (size < 2.5 || size > 60 || pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= camera.width ||
          pixel.y() >= camera.height) {
        continue;
      }
      WideDescriptor descriptor = p.descriptor;
      for (uint8_t& v : descriptor) {
        v = static_cast<uint8_t>(std::clamp(v + options.descriptor_noise * Gauss(random), 0.0, 127.0));
      }
      add(pixel, size, descriptor);
    }
    for (int i = 0; i < options.num_clutter; ++i)
      add({camera.width * random->Uniform(), camera.height * random->Uniform()}, 3 + 20 * random->Uniform(),
          RandomDescriptor(random));
    WideFrame& frame = frames.emplace_back();
    frame.keyframe = KeyframeId(static_cast<int32_t>(k));
    frame.utime = static_cast<int64_t>(1e6 * (first_s + 0.1 * static_cast<double>(k)));
    frame.cam_from_submap = TransformWorld(cameras[k], submap_from_world);
    frame.features = features;
  }
  SubmapView view;
  view.submap = submap;
  view.camera = camera;
  return MakeWideSide(view, std::move(frames), {});
}

}  // namespace mapmend::testing
