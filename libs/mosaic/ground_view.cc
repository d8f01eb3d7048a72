#include "libs/mosaic/ground_view.h"

#include <algorithm>
#include <cmath>

namespace mapmend {
namespace {

constexpr double kBorder = 0.1;                  // of the image's shorter side: within it quality falls to zero
constexpr double kMaxTangentOfFootprint = 2.75;  // 70 degrees from the vertical

double SmoothStep(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// Pixels around the border of an image.
std::vector<Eigen::Vector2f> BorderPixels(int width, int height) {
  constexpr int kPerSide = 8;
  const auto w = static_cast<float>(width - 1), h = static_cast<float>(height - 1);
  std::vector<Eigen::Vector2f> pixels;
  pixels.reserve(4 * kPerSide);
  for (int i = 0; i < kPerSide; ++i) pixels.emplace_back(w * static_cast<float>(i) / kPerSide, 0.0F);
  for (int i = 0; i < kPerSide; ++i) pixels.emplace_back(w, h * static_cast<float>(i) / kPerSide);
  for (int i = 0; i < kPerSide; ++i) pixels.emplace_back(w * (1 - static_cast<float>(i) / kPerSide), h);
  for (int i = 0; i < kPerSide; ++i) pixels.emplace_back(0.0F, h * (1 - static_cast<float>(i) / kPerSide));
  return pixels;
}

// Rays (z = 1) of the image's border that the lens model knows.
std::vector<Eigen::Vector3d> BorderRays(const Camera& camera) {
  const Pinhole ideal = camera.Ideal();
  std::vector<bool> seen;
  const std::vector<Eigen::Vector2f> pixels = camera.Undistort(BorderPixels(camera.width, camera.height), &seen);
  std::vector<Eigen::Vector3d> rays;
  rays.reserve(pixels.size());
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (seen[i]) rays.push_back(ideal.Unproject(pixels[i].cast<double>()));
  }
  return rays;
}

}  // namespace

GroundView::GroundView(const Camera& camera, const Rigid3& cam_from_ground)
    : camera_(camera),
      cam_from_ground_(cam_from_ground),
      center_(cam_from_ground.Center()),
      central_focal_(camera.Ideal().fx) {
  for (const Eigen::Vector3d& ray : BorderRays(camera)) max_tangent_ = std::max(max_tangent_, ray.head<2>().norm());
}

std::optional<GroundView::Sight> GroundView::See(const Eigen::Vector3d& place) const {
  const Eigen::Vector3d x = cam_from_ground_ * place;
  constexpr double kSlack = 1.02;
  if (!(x.z() > 0) || x.head<2>().norm() > kSlack * max_tangent_ * x.z()) return std::nullopt;
  Sight sight;
  sight.pixel = camera_.Project(x);
  const double u = sight.pixel.x(), v = sight.pixel.y();
  const double inside = std::min({u, v, camera_.width - 1 - u, camera_.height - 1 - v});
  if (!(inside >= 0)) return std::nullopt;
  const Eigen::Vector3d down = place - center_;
  const double cosine = -down.z() / down.norm();
  if (!(cosine > 0)) return std::nullopt;
  const double border = kBorder * std::min(camera_.width, camera_.height);
  constexpr double kLeast = 1e-3;  // a place that only one image shows, at its border, is still shown
  sight.quality = std::max(kLeast, SmoothStep(inside / border)) * cosine * cosine * cosine / x.z();
  sight.offset = 2 * (sight.pixel - Eigen::Vector2d(camera_.width, camera_.height) / 2).norm() /
                 std::hypot(camera_.width, camera_.height);
  return sight;
}

std::optional<Eigen::Vector2d> GroundView::Meet(const Eigen::Vector3d& ray_cam, const GroundSurface& surface) const {
  const Eigen::Vector3d ray = cam_from_ground_.rotation.conjugate() * ray_cam;
  Eigen::Vector2d slope = ray.head<2>() / std::max(-ray.z(), 1e-9);  // sideways per metre down
  if (ray.z() >= 0 && ray.head<2>().norm() < 1e-9) return std::nullopt;
  if (slope.norm() > kMaxTangentOfFootprint) slope *= kMaxTangentOfFootprint / slope.norm();
  Eigen::Vector2d place = center_.head<2>();
  constexpr int kIterations = 5;
  for (int i = 0; i < kIterations; ++i) {
    place = center_.head<2>() + slope * (center_.z() - surface.Height(place.x(), place.y()));
  }
  return place;
}

std::vector<Eigen::Vector2d> GroundView::Footprint(const GroundSurface& surface) const {
  std::vector<Eigen::Vector2d> footprint;
  for (const Eigen::Vector3d& ray : BorderRays(camera_)) {
    if (const auto place = Meet(ray, surface)) footprint.push_back(*place);
  }
  return footprint;
}

double GroundView::GroundSampleDistance(const GroundSurface& surface) const {
  const auto place = Meet(Eigen::Vector3d::UnitZ(), surface);
  if (!place) return 0;
  const Eigen::Vector3d ground(place->x(), place->y(), surface.Height(place->x(), place->y()));
  return (ground - center_).norm() / central_focal_;
}

double GroundView::Tilt() const {
  const Eigen::Vector3d axis = cam_from_ground_.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  return std::acos(std::clamp(-axis.z(), -1.0, 1.0));
}

}  // namespace mapmend
