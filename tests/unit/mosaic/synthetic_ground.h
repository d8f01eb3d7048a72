#pragma once

#include <cmath>
#include <opencv2/core.hpp>

#include "libs/mosaic/mosaic.h"

namespace mapmend {

// A flat ground at z = 0 with a smooth texture that does not repeat, and exact images of it from above.
class SyntheticGround {
 public:
  static cv::Vec3b ColorAt(double x, double y) {
    const double r = 120 + 50 * std::sin(0.9 * x + 0.3 * y) + 25 * std::sin(2.3 * y - 0.7 * x);
    const double g = 120 + 50 * std::cos(0.7 * y - 0.2 * x * y / 10) + 20 * std::sin(2.9 * x);
    const double b = 110 + 40 * std::sin(1.1 * x - 0.8 * y) + 30 * std::cos(0.13 * x * x);
    return {cv::saturate_cast<uint8_t>(b), cv::saturate_cast<uint8_t>(g), cv::saturate_cast<uint8_t>(r)};
  }

  static Camera MakeCamera() {
    Camera camera;
    camera.width = 320;
    camera.height = 240;
    camera.fx = camera.fy = 300;
    camera.cx = 160;
    camera.cy = 120;
    return camera;
  }

  // Looks down from (x, y, z), the image's top to the north, turned about the vertical and tilted to the north,
  // radians.
  static Rigid3 Above(double x, double y, double z, double turn = 0, double tilt = 0) {
    Eigen::Matrix3d down;
    down << 1, 0, 0, 0, -1, 0, 0, 0, -1;  // rows: the camera's axes in the ground's frame
    const Eigen::Matrix3d turned = Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitX()).toRotationMatrix() * down *
                                   Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const Eigen::Quaterniond q(turned);
    return {q, -(q * Eigen::Vector3d(x, y, z))};
  }

  // gain: of the exposure.
  static cv::Mat View(const MosaicImage& image, double gain = 1) {
    const Camera& camera = image.camera;
    cv::Mat view(camera.height, camera.width, CV_8UC3);
    const Pinhole ideal = camera.Ideal();
    const Rigid3 ground_from_cam = image.cam_from_ground.Inverse();
    std::vector<Eigen::Vector2f> pixels;
    for (int row = 0; row < camera.height; ++row) {
      for (int column = 0; column < camera.width; ++column)
        pixels.emplace_back(static_cast<float>(column), static_cast<float>(row));
    }
    const std::vector<Eigen::Vector2f> undistorted = camera.Undistort(pixels);
    for (size_t i = 0; i < pixels.size(); ++i) {
      const Eigen::Vector3d ray = ground_from_cam.rotation * ideal.Unproject(undistorted[i].cast<double>());
      const Eigen::Vector3d place = ground_from_cam.translation - ray * (ground_from_cam.translation.z() / ray.z());
      const cv::Vec3b color = ColorAt(place.x(), place.y());
      auto& pixel = view.at<cv::Vec3b>(static_cast<int>(pixels[i].y()), static_cast<int>(pixels[i].x()));
      for (int c = 0; c < 3; ++c) pixel[c] = cv::saturate_cast<uint8_t>(gain * color[c]);
    }
    return view;
  }

  // Map points all over the ground.
  static std::vector<Eigen::Vector3d> Points() {
    std::vector<Eigen::Vector3d> points;
    for (double x = -12; x <= 20; x += 0.5) {
      for (double y = -12; y <= 20; y += 0.5) points.emplace_back(x, y, 0);
    }
    return points;
  }
};

}  // namespace mapmend
