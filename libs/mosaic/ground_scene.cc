#include "libs/mosaic/ground_scene.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "libs/base/median.h"
#include "libs/base/text_format.h"

namespace mapmend {
namespace {

double MedianHeight(const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> heights;
  heights.reserve(points.size());
  for (const Eigen::Vector3d& p : points) heights.push_back(p.z());
  return Median(std::move(heights));
}

bool IsSame(const Camera& a, const Camera& b) {
  return a.model == b.model && a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy && a.distortion == b.distortion;
}

bool Touch(const GroundBounds& a, const GroundBounds& b) {
  return (a.high.array() >= b.low.array()).all() && (a.low.array() <= b.high.array()).all();
}

}  // namespace

bool Contains(const GroundBounds& bounds, const Eigen::Vector2d& place) {
  return (place.array() >= bounds.low.array()).all() && (place.array() <= bounds.high.array()).all();
}

GroundBounds BoundsOf(const std::vector<Eigen::Vector2d>& places) {
  GroundBounds bounds;
  if (!places.empty()) bounds.low = bounds.high = places.front();
  for (const Eigen::Vector2d& place : places) {
    bounds.low = bounds.low.cwiseMin(place);
    bounds.high = bounds.high.cwiseMax(place);
  }
  return bounds;
}

GroundScene::GroundScene(const GroundSceneOptions& options, std::vector<MosaicImage> images,
                         const std::vector<Eigen::Vector3d>& points)
    : options_(options),
      images_(std::move(images)),
      excluded_(images_.size(), false),
      is_leading_(images_.size(), true),
      is_set_aside_(images_.size(), false) {
  for (size_t i = 0; i < images_.size(); ++i) {
    if (images_[i].id < 0) images_[i].id = static_cast<int>(i);
  }
  if (images_.empty() || points.empty()) {
    problem_ = "the map has no keyframe or no point";
    return;
  }
  MakeViews();
  std::vector<double> tilts;
  for (const GroundView& view : views_) tilts.push_back(view.Tilt() * 180 / M_PI);
  if (const double tilt = Median(std::move(tilts)); tilt > options_.max_tilt_deg) {
    problem_ = Format("the camera looks %.0f degrees away from the ground: there is no picture of it from above", tilt);
    return;
  }
  FitSurface(points);
  if (!problem_.empty()) return;
  for (const GroundView& view : views_) {
    footprints_.push_back(BoundsOf(view.Footprint(surface_)));
    gsds_.push_back(view.GroundSampleDistance(surface_));
  }
  ChooseLeading();
}

// Those that were leading before, then by age: each that has none beside it.
void GroundScene::ChooseLeading() {
  is_leading_.assign(images_.size(), false);
  std::vector<int> leading;
  for (const bool before : {true, false}) {
    for (int i = 0; i < NumImages(); ++i) {
      if (Image(i).was_leading != before ||
          std::any_of(leading.begin(), leading.end(), [&](int other) { return IsBeside(i, other); }))
        continue;
      is_leading_[static_cast<size_t>(i)] = true;
      leading.push_back(i);
    }
  }
}

// Whether two images were taken from nearly the same place in nearly the same direction.
bool GroundScene::IsBeside(int image, int other) const {
  constexpr double kAlikeGsd = 1.15, kAlikeAngle = 0.17;  // 10 degrees
  const Camera& camera = Image(image).camera;
  const double side = Gsd(image) * std::min(camera.width, camera.height);
  if ((View(image).Center() - View(other).Center()).norm() >= options_.spacing * side) return false;
  const Eigen::Quaterniond &a = Image(image).cam_from_ground.rotation, &b = Image(other).cam_from_ground.rotation;
  return a.angularDistance(b) < kAlikeAngle && Gsd(image) < kAlikeGsd * Gsd(other) &&
         Gsd(other) < kAlikeGsd * Gsd(image);
}

// Images of one camera share what is worked out of it.
void GroundScene::MakeViews() {
  std::vector<std::shared_ptr<const GroundCamera>> cameras;
  for (const MosaicImage& image : images_) {
    auto camera = std::find_if(cameras.begin(), cameras.end(),
                               [&](const auto& known) { return IsSame(known->camera(), image.camera); });
    if (camera == cameras.end())
      camera = cameras.insert(cameras.end(), std::make_shared<const GroundCamera>(image.camera));
    views_.emplace_back(*camera, image.cam_from_ground, image.motion);
  }
}

void GroundScene::FitSurface(const std::vector<Eigen::Vector3d>& points) {
  surface_ = GroundSurface(MedianHeight(points));
  std::vector<Eigen::Vector2d> corners;
  std::vector<double> heights;
  for (const GroundView& view : views_) {
    const std::vector<Eigen::Vector2d> footprint = view.Footprint(surface_);
    corners.insert(corners.end(), footprint.begin(), footprint.end());
    heights.push_back(view.Center().z() - surface_.Height(view.Center().x(), view.Center().y()));
  }
  surface_ = GroundSurface(points, BoundsOf(corners), options_.surface);
  const double height = Median(std::move(heights));
  if (!(height > 0)) {
    problem_ = "the camera is below the ground: the map stands on its head, or shows no ground";
  } else if (surface_.MedianResidual() > options_.max_relief * height) {
    problem_ = Format("the points lie %.0f %% of the height above them away from any ground surface",
                      100 * surface_.MedianResidual() / height);
  }
}

GroundBounds GroundScene::Bounds() const {
  std::vector<Eigen::Vector2d> corners;
  for (size_t i = 0; i < footprints_.size(); ++i) {
    if (excluded_[i]) continue;
    corners.push_back(footprints_[i].low);
    corners.push_back(footprints_[i].high);
  }
  return BoundsOf(corners);
}

double GroundScene::Gsd() const { return Median(gsds_); }

std::vector<int> GroundScene::Near(const GroundBounds& bounds) const {
  std::vector<int> near;
  for (size_t i = 0; i < footprints_.size(); ++i) {
    if (!excluded_[i] && Touch(footprints_[i], bounds)) near.push_back(static_cast<int>(i));
  }
  return near;
}

void GroundScene::Reduce(int image, double share) {
  MosaicImage& reduced = images_[static_cast<size_t>(image)];
  reduced.camera = reduced.camera.Scaled(share);
  views_[static_cast<size_t>(image)] = GroundView(reduced.camera, reduced.cam_from_ground, reduced.motion);
}

}  // namespace mapmend
