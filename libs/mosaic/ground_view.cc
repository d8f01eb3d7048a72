#include "libs/mosaic/ground_view.h"

#include <algorithm>
#include <cmath>
#include <utility>

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

GroundCamera::GroundCamera(const Camera& camera)
    : camera_(camera), border_rays_(BorderRays(camera)), central_focal_(camera.Ideal().fx) {
  for (const Eigen::Vector3d& ray : border_rays_) max_tangent_ = std::max(max_tangent_, ray.head<2>().norm());
}

GroundView::GroundView(std::shared_ptr<const GroundCamera> camera, const Rigid3& cam_from_ground,
                       const ReadoutMotion& motion)
    : camera_(std::move(camera)),
      cam_from_ground_(cam_from_ground),
      motion_(motion),
      is_moving_(!motion.IsZero()),
      center_(cam_from_ground.Center()),
      border_(kBorder * std::min(camera_->camera().width, camera_->camera().height)) {}

std::optional<GroundView::Sight> GroundView::Project(const Eigen::Vector3d& place) const {
  const Camera& camera = camera_->camera();
  const Eigen::Vector3d x = cam_from_ground_ * place;
  constexpr double kSlack = 1.02;
  if (!(x.z() > 0) || x.head<2>().norm() > kSlack * camera_->max_tangent() * x.z()) return std::nullopt;
  Sight sight;
  sight.pixel = camera.Project(x);
  // The line in which the place is seen tells where the camera was, which tells the line.
  constexpr int kRounds = 2;
  for (int i = 0; is_moving_ && i < kRounds; ++i) {
    const double line = motion_.by_columns ? sight.pixel.x() / camera.width : sight.pixel.y() / camera.height;
    const double when = std::clamp(line, 0.0, 1.0) - 0.5;
    const Eigen::Vector3d moved = x - when * (motion_.shift + motion_.turn.cross(x));
    if (!(moved.z() > 0)) return std::nullopt;
    sight.pixel = camera.Project(moved);
  }
  const double u = sight.pixel.x(), v = sight.pixel.y();
  sight.inside = std::min({u, v, camera.width - 1 - u, camera.height - 1 - v});
  const Eigen::Vector3d down = place - center_;
  const double cosine = -down.z() / down.norm();
  if (!(cosine > 0) || std::isnan(sight.inside)) return std::nullopt;
  sight.steepness = cosine * cosine * cosine / x.z();
  sight.offset = 2 * (sight.pixel - Eigen::Vector2d(camera.width, camera.height) / 2).norm() /
                 std::hypot(camera.width, camera.height);
  return sight;
}

std::optional<GroundView::Sight> GroundView::See(const Eigen::Vector3d& place) const {
  std::optional<Sight> sight = Project(place);
  return sight && sight->inside >= 0 ? sight : std::nullopt;
}

double GroundView::Quality(double steepness, double inside) const {
  if (!(inside >= 0)) return 0;
  constexpr double kLeast = 1e-3;  // a place that only one image shows, at its border, is still shown
  return std::max(kLeast, SmoothStep(inside / border_)) * steepness;
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
  for (const Eigen::Vector3d& ray : camera_->border_rays()) {
    if (const auto place = Meet(ray, surface)) footprint.push_back(*place);
  }
  return footprint;
}

double GroundView::GroundSampleDistance(const GroundSurface& surface) const {
  const auto place = Meet(Eigen::Vector3d::UnitZ(), surface);
  if (!place) return 0;
  const Eigen::Vector3d ground(place->x(), place->y(), surface.Height(place->x(), place->y()));
  return (ground - center_).norm() / camera_->central_focal();
}

double GroundView::Tilt() const {
  const Eigen::Vector3d axis = cam_from_ground_.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  return std::acos(std::clamp(-axis.z(), -1.0, 1.0));
}

}  // namespace mapmend
