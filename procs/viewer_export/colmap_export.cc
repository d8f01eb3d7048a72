#include "procs/viewer_export/colmap_export.h"

#include <cstdio>
#include <map>
#include <utility>
#include <vector>

namespace mapmend {
namespace {

template <typename... Args>
std::string Print(const char* format, Args... args) {
  char text[512];
  std::snprintf(text, sizeof(text), format, args...);
  return text;
}

// Finds the listed point that an observation belongs to, also where its own point was fused into others.
class PointResolver {
 public:
  PointResolver(const Snapshot& snapshot, const std::vector<ColoredPoint>& points) {
    for (size_t i = 0; i < points.size(); ++i) {
      index_[{snapshot.submaps[points[i].submap].key.session, points[i].id}] = static_cast<int>(i);
    }
    for (const RefinedSubmap& refined : snapshot.model->Revision().refined) {
      for (const RefinedSubmap::Fused& f : refined.fused)
        fused_[{refined.key.session, f.id}] = {f.into_session, f.into};
    }
  }

  // Index into the list of points, -1 without.
  int Find(const std::string& session, MapPointId id) const {
    std::pair<std::string, MapPointId> key = {session, id};
    for (size_t step = 0; step <= fused_.size(); ++step) {
      if (const auto it = index_.find(key); it != index_.end()) return it->second;
      const auto it = fused_.find(key);
      if (it == fused_.end()) return -1;
      key = it->second;
    }
    return -1;  // a cycle
  }

 private:
  std::map<std::pair<std::string, MapPointId>, int> index_;
  std::map<std::pair<std::string, MapPointId>, std::pair<std::string, MapPointId>> fused_;
};

struct Track {
  std::string elements;  // " IMAGE_ID POINT2D_IDX ..."
  double error_sum = 0;
  int length = 0;
};

}  // namespace

ColmapModel MakeColmapModel(const Snapshot& snapshot, int component) {
  const std::vector<ColoredPoint> points = ComponentPoints(snapshot, component);
  const PointResolver resolver(snapshot, points);
  std::vector<Track> tracks(points.size());
  ColmapModel model;
  model.cameras = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[] = fx fy cx cy\n";
  const std::vector<std::string>& sessions = snapshot.model->SessionOrder();
  for (size_t s = 0; s < sessions.size(); ++s) {
    const Pinhole& p = snapshot.model->GetSession(sessions[s]).info.pinhole;
    model.cameras += Print("%zu PINHOLE %d %d %.10g %.10g %.10g %.10g\n", s + 1, p.width, p.height, p.fx, p.fy,
                           p.cx + 0.5, p.cy + 0.5);
  }
  model.images = "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n";
  int image_id = 0;
  for (const SnapshotKeyframe& placed : snapshot.components[component].keyframes) {
    const SnapshotSubmap& submap = snapshot.submaps[placed.submap];
    const SubmapKeyframe& keyframe = submap.submap->keyframes.at(placed.id);
    const Pinhole& pinhole = snapshot.model->GetSession(submap.key.session).info.pinhole;
    const Eigen::Quaterniond& q = placed.cam_from_root.rotation;
    const Eigen::Vector3d& t = placed.cam_from_root.translation;
    model.images += Print("%d %.12g %.12g %.12g %.12g %.12g %.12g %.12g %d %d/frame_%06d.png\n", ++image_id, q.w(),
                          q.x(), q.y(), q.z(), t.x(), t.y(), t.z(), submap.session + 1, submap.session, keyframe.frame);
    for (int i = 0; i < keyframe.features.Size(); ++i) {
      const Eigen::Vector2d pixel = keyframe.features.keypoints[i].pixel.cast<double>();
      const MapPointId id = keyframe.map_points[i];
      const int point = id.IsValid() ? resolver.Find(submap.key.session, id) : -1;
      model.images +=
          Print("%s%.2f %.2f %d", i == 0 ? "" : " ", pixel.x() + 0.5, pixel.y() + 0.5, point < 0 ? -1 : point + 1);
      if (point < 0) continue;
      Track& track = tracks[point];
      track.elements += Print(" %d %d", image_id, i);
      track.error_sum += (pinhole.Project(placed.cam_from_root * points[point].position) - pixel).norm();
      ++track.length;
    }
    model.images += "\n";
  }
  model.points = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n";
  for (size_t i = 0; i < points.size(); ++i) {
    if (tracks[i].length == 0) continue;  // seen from culled keyframes only
    const Eigen::Vector3d& p = points[i].position;
    model.points += Print("%zu %.9g %.9g %.9g %d %d %d %.4f", i + 1, p.x(), p.y(), p.z(), points[i].color[0],
                          points[i].color[1], points[i].color[2], tracks[i].error_sum / tracks[i].length) +
                    tracks[i].elements + "\n";
  }
  return model;
}

}  // namespace mapmend
