#include "procs/viewer_export/colmap_model.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <utility>

#include "libs/stream/keyframe_images.h"
#include "procs/viewer_export/image_pixels.h"

namespace mapmend {
namespace {

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

// The cameras of the pictures: one for each session and size of pictures.
class Cameras {
 public:
  explicit Cameras(ColmapModel* model) : model_(model) {}
  // Its number.
  int Add(int session, const Camera& camera) {
    const auto colmap = ToColmapCamera(camera);
    ColmapCamera added = colmap ? *colmap : ToColmapCamera(camera.Ideal());
    const auto [it, is_new] = numbers_.try_emplace({session, added.width, added.height}, 0);
    if (is_new) {
      model_->cameras.push_back(std::move(added));
      it->second = static_cast<int>(model_->cameras.size());
    }
    return it->second;
  }

 private:
  ColmapModel* model_;
  std::map<std::array<int, 3>, int> numbers_;
};

}  // namespace

std::string ColmapPictureName(int session, int frame, const std::string& suffix) {
  char name[64];
  std::snprintf(name, sizeof(name), "%d/frame_%06d.", session, frame);
  return name + suffix;
}

ColmapModel MakeColmapModel(const Snapshot& snapshot, int component, const ColmapPictures& pictures, double max_error) {
  const std::vector<ColoredPoint> points = ComponentPoints(snapshot, component);
  const PointResolver resolver(snapshot, points);
  ColmapModel model;
  Cameras cameras(&model);
  std::vector<ColmapModel::Point> tracks(points.size());
  for (const SnapshotKeyframe& placed : snapshot.components[component].keyframes) {
    const SnapshotSubmap& submap = snapshot.submaps[placed.submap];
    const SubmapKeyframe& keyframe = submap.submap->keyframes.at(placed.id);
    const SessionStarted& session = snapshot.model->GetSession(submap.key.session).info;
    const auto picture = pictures.find({submap.key.session, placed.id});
    const bool has_picture = picture != pictures.end();
    const ImagePixels pixels(session.camera, session.pinhole,
                             has_picture ? picture->second.width : session.pinhole.width,
                             has_picture ? picture->second.height : session.pinhole.height);
    // Without a model of COLMAP's for the lens, pictures are undistorted ones.
    const bool is_distorted = ToColmapCamera(pixels.GetCamera()).has_value();
    const Pinhole ideal = pixels.GetCamera().Ideal();
    const auto project = [&](const Eigen::Vector3d& p) {
      return is_distorted ? pixels.FromCamera(p) : ideal.Project(p);
    };
    ColmapModel::Image image;
    image.id = static_cast<int>(model.images.size()) + 1;
    image.camera = cameras.Add(submap.session, pixels.GetCamera());
    image.name =
        has_picture ? picture->second.name : ColmapPictureName(submap.session, keyframe.frame, ImageSuffix("jpeg"));
    image.cam_from_world = placed.cam_from_root;
    for (int i = 0; i < keyframe.features.Size(); ++i) {
      const Eigen::Vector2d pixel =
          project(session.pinhole.Unproject(keyframe.features.keypoints[i].pixel.cast<double>()));
      ColmapModel::Feature feature{pixel.x() + 0.5, pixel.y() + 0.5, -1};
      const MapPointId id = keyframe.map_points[i];
      const int point = id.IsValid() ? resolver.Find(submap.key.session, id) : -1;
      if (point >= 0) {
        const Eigen::Vector3d in_camera = placed.cam_from_root * points[point].position;
        const double error = in_camera.z() > 0 ? (project(in_camera) - pixel).norm() : max_error + 1;
        ColmapModel::Point& track = tracks[point];
        // A picture sees a point once.
        const bool is_seen = !track.track.empty() && track.track.back().image == image.id;
        if (error <= max_error && !is_seen) {
          feature.point = point + 1;
          track.track.push_back({image.id, i});
          track.error += error;
        }
      }
      image.features.push_back(feature);
    }
    model.images.push_back(std::move(image));
  }
  for (size_t i = 0; i < points.size(); ++i) {
    ColmapModel::Point& point = tracks[i];
    point.id = static_cast<int>(i) + 1;
    if (point.track.size() < 2) {  // seen from culled keyframes
      for (const auto& [image, feature] : point.track)
        model.images[static_cast<size_t>(image) - 1].features[static_cast<size_t>(feature)].point = -1;
      continue;
    }
    point.position = points[i].position;
    point.color = points[i].color;
    point.error /= static_cast<double>(point.track.size());
    model.points.push_back(std::move(point));
  }
  return model;
}

}  // namespace mapmend
