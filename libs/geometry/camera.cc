#include "libs/geometry/camera.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

namespace mapmend {

Eigen::Vector2d Camera::Project(const Eigen::Vector3d& x_cam) const {
  const double x = x_cam.x() / x_cam.z(), y = x_cam.y() / x_cam.z();
  const auto& d = distortion;
  const double r2 = x * x + y * y;
  if (model == Model::kPinhole) {
    const double radial = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
    const double xd = x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x);
    const double yd = y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y;
    return {fx * xd + cx, fy * yd + cy};
  }
  const double r = std::sqrt(r2), theta = std::atan(r), t2 = theta * theta;
  const double theta_d = theta * (1 + t2 * (d[0] + t2 * (d[1] + t2 * (d[2] + t2 * d[3]))));
  const double scale = r > 1e-12 ? theta_d / r : 1.0;
  return {fx * x * scale + cx, fy * y * scale + cy};
}

Camera Camera::Scaled(double factor) const {
  Camera scaled = *this;
  // Pixel centres are at integers: a pixel u of the large image lies at (u + 0.5) * factor - 0.5 of the small one.
  scaled.fx *= factor;
  scaled.fy *= factor;
  scaled.cx = (cx + 0.5) * factor - 0.5;
  scaled.cy = (cy + 0.5) * factor - 0.5;
  scaled.width = static_cast<int>(std::lround(width * factor));
  scaled.height = static_cast<int>(std::lround(height * factor));
  return scaled;
}

bool Camera::HasDistortion() const {
  return model == Model::kFisheye || std::any_of(distortion.begin(), distortion.end(), [](double v) { return v != 0; });
}

std::vector<Eigen::Vector2f> Camera::Undistort(const std::vector<Eigen::Vector2f>& pixels) const {
  if (pixels.empty() || !HasDistortion()) return pixels;
  const cv::Mat source(static_cast<int>(pixels.size()), 1, CV_32FC2, const_cast<Eigen::Vector2f*>(pixels.data()));
  const cv::Matx33d K(fx, 0, cx, 0, fy, cy, 0, 0, 1);
  cv::Mat target;
  if (model == Model::kPinhole) {
    const cv::Vec<double, 5> d(distortion[0], distortion[1], distortion[2], distortion[3], distortion[4]);
    cv::undistortPoints(source, target, K, d, cv::noArray(), K,
                        cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 20, 1e-6));
  } else {
    const cv::Vec4d d(distortion[0], distortion[1], distortion[2], distortion[3]);
    cv::fisheye::undistortPoints(source, target, K, d, cv::noArray(), K);
  }
  std::vector<Eigen::Vector2f> result(pixels.size());
  for (size_t i = 0; i < pixels.size(); ++i) {
    const auto& p = target.at<cv::Vec2f>(static_cast<int>(i));
    result[i] = {p[0], p[1]};
  }
  return result;
}

}  // namespace mapmend
