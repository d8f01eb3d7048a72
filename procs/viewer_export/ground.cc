#include "procs/viewer_export/ground.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "libs/base/median.h"
#include "libs/map_view/level_frame.h"

namespace mapmend {
namespace {

constexpr double kMaxReach = 5;    // of the height
constexpr double kMinAbove = 0.9;  // share of cameras above the ground
constexpr double kFlat = 0.35;     // of the height of the cameras: what most points lie within
constexpr size_t kMinPoints = 10;

// Where the ray of a pixel meets the height z.
Eigen::Vector3d OnGround(const Pinhole& camera, const Rigid3& world_from_cam, const Eigen::Vector2d& pixel, double z) {
  const Eigen::Vector3d ray = world_from_cam.rotation * Eigen::Vector3d((pixel.x() - camera.cx) / camera.fx,
                                                                        (pixel.y() - camera.cy) / camera.fy, 1);
  const Eigen::Vector3d& center = world_from_cam.translation;
  const double height = center.z() - z;
  const double along = ray.head<2>().norm(), reach = ray.z() < 0 ? along * height / -ray.z() : 1e300;
  const double limited = std::min(reach, kMaxReach * height);
  Eigen::Vector3d point(center.x(), center.y(), z);
  if (along > 1e-12) point.head<2>() += ray.head<2>() / along * limited;
  return point;
}

using PointMap = std::map<std::pair<int, MapPointId>, Eigen::Vector3d>;

double GroundHeight(const Snapshot& snapshot, const SnapshotKeyframe& keyframe, const PointMap& points,
                    double otherwise) {
  const SubmapKeyframe& source = snapshot.submaps[keyframe.submap].submap->keyframes.at(keyframe.id);
  std::vector<double> heights;
  for (const MapPointId id : source.map_points) {
    const auto it = id.IsValid() ? points.find({keyframe.submap, id}) : points.end();
    if (it != points.end()) heights.push_back(it->second.z());
  }
  constexpr size_t kEnough = 8;
  return heights.size() < kEnough ? otherwise : Median(std::move(heights));
}

// Whether points so high are the ground below the cameras, and not the room around them.
bool IsGround(const SnapshotComponent& component, const Rigid3& level_from_world, double usual,
              std::vector<double> heights) {
  std::vector<double> above;
  for (const SnapshotKeyframe& k : component.keyframes)
    above.push_back((level_from_world * k.cam_from_root.Center()).z() - usual);
  const auto num_above = std::count_if(above.begin(), above.end(), [](double a) { return a > 0; });
  if (static_cast<double>(num_above) < kMinAbove * static_cast<double>(above.size())) return false;
  for (double& height : heights) height = std::abs(height - usual);
  return Median(std::move(heights)) <= kFlat * Median(std::move(above));
}

}  // namespace

double Footprint::Length() const {
  return 0.5 * ((corners[0] - corners[3]).head<2>().norm() + (corners[1] - corners[2]).head<2>().norm());
}
double Footprint::Width() const {
  return 0.5 * ((corners[0] - corners[1]).head<2>().norm() + (corners[3] - corners[2]).head<2>().norm());
}
double Footprint::Area() const {
  double twice = 0;
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d &a = corners[i], &b = corners[(i + 1) % 4];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return std::abs(twice) / 2;
}

std::optional<Ground> FindGround(const Snapshot& snapshot, int component, bool is_level) {
  const SnapshotComponent& c = snapshot.components[component];
  if (c.keyframes.empty()) return std::nullopt;
  Ground ground;
  if (!is_level) ground.level_from_world = FindLevelFrame(component, snapshot).level_from_map;
  PointMap points;
  std::vector<double> all_heights, camera_heights;
  for (const ColoredPoint& point : ComponentPoints(snapshot, component)) {
    const Eigen::Vector3d position = ground.level_from_world * point.position;
    points[{point.submap, point.id}] = position;
    all_heights.push_back(position.z());
  }
  if (points.size() < kMinPoints) return std::nullopt;
  const double usual = Median(all_heights);
  if (!is_level && !IsGround(c, ground.level_from_world, usual, std::move(all_heights))) return std::nullopt;
  for (const SnapshotKeyframe& k : c.keyframes) {
    const Rigid3 world_from_cam = ground.level_from_world * k.cam_from_root.Inverse();
    const double z = GroundHeight(snapshot, k, points, usual);
    if (world_from_cam.translation.z() <= z) continue;  // nothing below it
    const SnapshotSubmap& submap = snapshot.submaps[k.submap];
    const Pinhole& camera = snapshot.model->GetSession(submap.key.session).info.pinhole;
    Footprint footprint;
    footprint.submap = k.submap;
    footprint.keyframe = k.id;
    footprint.utime = k.utime;
    footprint.camera = world_from_cam.translation;
    const double right = camera.width - 1, bottom = camera.height - 1;
    const std::array<Eigen::Vector2d, 4> pixels = {Eigen::Vector2d(0, 0), {right, 0}, {right, bottom}, {0, bottom}};
    for (size_t i = 0; i < pixels.size(); ++i) footprint.corners[i] = OnGround(camera, world_from_cam, pixels[i], z);
    ground.footprints.push_back(footprint);
    camera_heights.push_back(footprint.camera.z() - z);
  }
  if (ground.footprints.empty()) return std::nullopt;
  ground.height = Median(std::move(camera_heights));
  return ground;
}

}  // namespace mapmend
