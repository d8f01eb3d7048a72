#include "libs/geometry/camera.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "libs/geometry/lens.h"

namespace mapmend {
namespace {

struct ModelInfo {
  const char* name;
  int num_coefficients;
};
// In the order of Camera::Model.
constexpr ModelInfo kModels[] = {
    {"pinhole", 5},       {"fisheye", 4},          {"rational", 14},          {"fov", 1},     {"omni", 5},
    {"double_sphere", 2}, {"extended_unified", 2}, {"thin_prism_fisheye", 8}, {"division", 1}};

constexpr double kMaxBack = 1.0;        // pixels off after projecting back
constexpr double kMinCosine = 0.01745;  // 89 degrees
constexpr double kMaxTangent = 57.29;   // the same

}  // namespace

Eigen::Vector2d Camera::Project(const Eigen::Vector3d& x_cam) const {
  if (model != Model::kPinhole && model != Model::kFisheye) {
    const Eigen::Vector2d plane = Distort(*this, x_cam);
    return {fx * plane.x() + cx, fy * plane.y() + cy};
  }
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

Camera Camera::Resized(int new_width, int new_height) const {
  Camera resized = *this;
  const double sx = new_width / static_cast<double>(width), sy = new_height / static_cast<double>(height);
  resized.fx *= sx;
  resized.fy *= sy;
  resized.cx = (cx + 0.5) * sx - 0.5;
  resized.cy = (cy + 0.5) * sy - 0.5;
  resized.width = new_width;
  resized.height = new_height;
  return resized;
}

Pinhole Camera::Ideal() const {
  const double scale = CentralScale(*this);
  return {fx * scale, fy * scale, cx, cy, width, height};
}

std::string Camera::ModelName() const { return kModels[static_cast<int>(model)].name; }

int Camera::NumCoefficients() const { return kModels[static_cast<int>(model)].num_coefficients; }

bool Camera::HasDistortion() const {
  return model != Model::kPinhole || std::any_of(distortion.begin(), distortion.end(), [](double v) { return v != 0; });
}

bool ParseCameraModel(const std::string& name, Camera::Model* model) {
  for (size_t i = 0; i < std::size(kModels); ++i) {
    if (name != kModels[i].name) continue;
    *model = static_cast<Camera::Model>(i);
    return true;
  }
  return false;
}

std::vector<Eigen::Vector2f> Camera::Undistort(const std::vector<Eigen::Vector2f>& pixels,
                                               std::vector<bool>* seen) const {
  if (seen != nullptr) seen->assign(pixels.size(), true);
  if (pixels.empty() || !HasDistortion()) return pixels;
  const Pinhole ideal = Ideal();
  std::vector<Eigen::Vector2f> result(pixels.size());
  if (model != Model::kPinhole && model != Model::kFisheye) {
    const double limit = RadialLimit(*this);
    for (size_t i = 0; i < pixels.size(); ++i) {
      const auto ray = Ray(*this, {(pixels[i].x() - cx) / fx, (pixels[i].y() - cy) / fy}, limit);
      const bool inside = ray && ray->z() > kMinCosine;
      result[i] = inside ? ideal.Project(*ray).cast<float>() : pixels[i];
      if (seen != nullptr) (*seen)[i] = inside;
    }
    return result;
  }
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
  for (size_t i = 0; i < pixels.size(); ++i) {
    const auto& p = target.at<cv::Vec2f>(static_cast<int>(i));
    result[i] = {p[0], p[1]};
  }
  if (seen == nullptr) return result;
  const double limit = model == Model::kPinhole ? RadialLimit(*this) : std::tan(std::min(RadialLimit(*this), 1.5707));
  for (size_t i = 0; i < pixels.size(); ++i) {
    const Eigen::Vector3d ray = ideal.Unproject(result[i].cast<double>());
    const double r = ray.head<2>().norm();
    const double back = (Project(ray) - pixels[i].cast<double>()).norm();
    (*seen)[i] = r <= std::min(limit, kMaxTangent) && back <= kMaxBack;
  }
  return result;
}

}  // namespace mapmend
