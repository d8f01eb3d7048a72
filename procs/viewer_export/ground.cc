#include "procs/viewer_export/ground.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "libs/base/median.h"

namespace mapmend {
namespace {

constexpr double kMaxReach = 5;    // of the height
constexpr double kMinAbove = 0.9;  // share of cameras above the plane
constexpr double kFlat = 0.35;     // of the height: what most points lie within
constexpr size_t kMinPoints = 10;

struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double offset = 0;  // normal . x = offset
  double Above(const Eigen::Vector3d& x) const { return normal.dot(x) - offset; }
};

// The plane that most points are near to: reweighted least squares with Cauchy's weights.
Plane FitPlane(const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> weights(points.size(), 1);
  Plane plane;
  for (int i = 0; i < 20; ++i) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    double sum = 0;
    for (size_t k = 0; k < points.size(); ++k) {
      mean += weights[k] * points[k];
      sum += weights[k];
    }
    mean /= sum;
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (size_t k = 0; k < points.size(); ++k)
      scatter += weights[k] * (points[k] - mean) * (points[k] - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
    plane.normal = solver.eigenvectors().col(0);
    plane.offset = plane.normal.dot(mean);
    std::vector<double> distances;
    for (const Eigen::Vector3d& point : points) distances.push_back(std::abs(plane.Above(point)));
    const double spread = std::max(1e-9, 2.2 * Median(distances));
    for (size_t k = 0; k < points.size(); ++k) weights[k] = 1 / (1 + std::pow(distances[k] / spread, 2));
  }
  return plane;
}

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
  std::vector<Eigen::Vector3d> positions;
  PointMap points;
  for (const ColoredPoint& point : ComponentPoints(snapshot, component)) {
    positions.push_back(point.position);
    points[{point.submap, point.id}] = point.position;
  }
  if (positions.size() < kMinPoints || c.keyframes.empty()) return std::nullopt;
  Ground ground;
  if (!is_level) {
    Plane plane = FitPlane(positions);
    std::vector<double> above, off;
    for (const SnapshotKeyframe& k : c.keyframes) above.push_back(plane.Above(k.cam_from_root.Center()));
    for (const Eigen::Vector3d& x : positions) off.push_back(std::abs(plane.Above(x)));
    const double height = Median(above);
    if (height < 0) plane.normal = -plane.normal;
    const auto num_above = std::count_if(above.begin(), above.end(), [&](double a) { return a * height > 0; });
    if (static_cast<double>(num_above) < kMinAbove * static_cast<double>(above.size()) ||
        Median(off) > kFlat * std::abs(height))
      return std::nullopt;
    ground.level_from_world = Eigen::Quaterniond::FromTwoVectors(plane.normal, Eigen::Vector3d::UnitZ());
    for (auto& [key, position] : points) position = ground.level_from_world * position;
  }
  std::vector<double> all_heights, camera_heights;
  for (const auto& [key, position] : points) all_heights.push_back(position.z());
  const double usual = Median(std::move(all_heights));
  for (const SnapshotKeyframe& k : c.keyframes) {
    const Rigid3 world_from_cam = Rigid3(ground.level_from_world, Eigen::Vector3d::Zero()) * k.cam_from_root.Inverse();
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
