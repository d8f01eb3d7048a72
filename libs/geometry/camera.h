#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace mapmend {

// An ideal pinhole camera, pixels: u = fx x/z + cx, v = fy y/z + cy. All features in mapmend are undistorted into one.
struct Pinhole {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  int width = 0, height = 0;

  Eigen::Vector2d Project(const Eigen::Vector3d& x_cam) const {
    return {fx * x_cam.x() / x_cam.z() + cx, fy * x_cam.y() / x_cam.z() + cy};
  }
  // Ray with z = 1.
  Eigen::Vector3d Unproject(const Eigen::Vector2d& pixel) const {
    return {(pixel.x() - cx) / fx, (pixel.y() - cy) / fy, 1.0};
  }
};

// A real camera with lens distortion.
//   pinhole  radial-tangential, OpenCV's model: k1 k2 p1 p2 k3
//   fisheye  Kannala-Brandt (J. Kannala, S. Brandt, PAMI 2006), OpenCV's fisheye model: k1 k2 k3 k4
struct Camera {
  enum class Model { kPinhole, kFisheye };

  Model model = Model::kPinhole;
  int width = 0, height = 0;  // pixels; 0 if the file does not say
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, 5> distortion = {0, 0, 0, 0, 0};
  double fps = 0;  // 0 if the file does not say

  // Distorted pixel of a point in camera coordinates (z > 0).
  Eigen::Vector2d Project(const Eigen::Vector3d& x_cam) const;
  // The same camera for images scaled by factor (1 = unchanged).
  Camera Scaled(double factor) const;
  // The ideal pinhole camera with the same fx, fy, cx, cy, into which Undistort maps.
  Pinhole Ideal() const { return {fx, fy, cx, cy, width, height}; }
  // Distorted pixels to pixels of Ideal(). Where the distortion is zero the pixels are returned as they are.
  std::vector<Eigen::Vector2f> Undistort(const std::vector<Eigen::Vector2f>& pixels) const;
  bool HasDistortion() const;
  std::string ModelName() const { return model == Model::kPinhole ? "pinhole" : "fisheye"; }
};

// Reads a calibration: ORB-SLAM2/3 yaml (Camera.fx or Camera1.fx ...), Kalibr camchain yaml, COLMAP cameras.txt, OpenCV
// calibration yaml. Throws std::runtime_error with one line that names the file and the missing or wrong key.
Camera ReadCamera(const std::string& path);

}  // namespace mapmend
