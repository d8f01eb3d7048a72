#include "procs/viewer_export/colmap_model.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstdio>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "libs/map_view/image_pixels.h"
#include "libs/stream/keyframe_images.h"

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

// A picture as COLMAP's camera projects into it. Without a model of COLMAP's for the lens, pictures are undistorted
// ones.
class View {
 public:
  View(const ImagePixels& pixels, const Rigid3& cam_from_world)
      : pixels_(pixels),
        ideal_(pixels.GetCamera().Ideal()),
        is_distorted_(ToColmapCamera(pixels.GetCamera()).has_value()),
        cam_from_world_(cam_from_world) {}

  Eigen::Vector2d Project(const Eigen::Vector3d& in_camera) const {
    return is_distorted_ ? pixels_.FromCamera(in_camera) : ideal_.Project(in_camera);
  }
  // nullopt behind the camera.
  std::optional<Eigen::Vector2d> ProjectPoint(const Eigen::Vector3d& in_world) const {
    const Eigen::Vector3d in_camera = cam_from_world_ * in_world;
    return in_camera.z() > 0 ? std::optional(Project(in_camera)) : std::nullopt;
  }
  double Depth(const Eigen::Vector3d& in_world) const { return (cam_from_world_ * in_world).z(); }

 private:
  ImagePixels pixels_;
  Pinhole ideal_;
  bool is_distorted_;
  Rigid3 cam_from_world_;
};

// What a point's observations say of it.
class PointFit {
 public:
  PointFit(const ColmapModel& model, const std::vector<View>& views, const ColmapModel::Point& point) {
    for (const auto& [image, feature] : point.track) {
      const auto i = static_cast<size_t>(image) - 1;
      const ColmapModel::Feature& f = model.images[i].features[static_cast<size_t>(feature)];
      seen_.push_back({&views[i], {f.x - 0.5, f.y - 0.5}});
    }
  }

  // Where all observations, taken alike as COLMAP takes them, are met best; the cameras stay.
  Eigen::Vector3d Refine(Eigen::Vector3d position) const {
    constexpr int kMaxSteps = 5;
    double cost = Cost(position);
    for (int step = 0; step < kMaxSteps; ++step) {
      Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
      Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
      for (const auto& [view, pixel] : seen_) {
        const auto projected = view->ProjectPoint(position);
        if (!projected) return position;
        const double h = 1e-6 * view->Depth(position);
        Eigen::Matrix<double, 2, 3> jacobian;
        for (int k = 0; k < 3; ++k) {
          const auto moved = view->ProjectPoint(position + h * Eigen::Vector3d::Unit(k));
          if (!moved) return position;
          jacobian.col(k) = (*moved - *projected) / h;
        }
        hessian += jacobian.transpose() * jacobian;
        gradient += jacobian.transpose() * (*projected - pixel);
      }
      const Eigen::Vector3d next = position - hessian.ldlt().solve(gradient);
      const double next_cost = next.allFinite() ? Cost(next) : cost;
      if (!(next_cost < cost)) break;
      position = next;
      cost = next_cost;
    }
    return position;
  }
  // Pixels.
  double MeanError(const Eigen::Vector3d& position) const {
    double sum = 0;
    for (const auto& [view, pixel] : seen_) sum += (view->ProjectPoint(position).value_or(pixel) - pixel).norm();
    return sum / static_cast<double>(seen_.size());
  }

 private:
  double Cost(const Eigen::Vector3d& position) const {
    double sum = 0;
    for (const auto& [view, pixel] : seen_) {
      const auto projected = view->ProjectPoint(position);
      if (!projected) return std::numeric_limits<double>::infinity();
      sum += (*projected - pixel).squaredNorm();
    }
    return sum;
  }

  struct Seen {
    const View* view;
    Eigen::Vector2d pixel;
  };
  std::vector<Seen> seen_;
};

// Points with at least two observations; the observations of the others are taken back.
void ListPoints(const std::vector<ColoredPoint>& points, const std::vector<View>& views,
                std::vector<ColmapModel::Point>* tracks, ColmapModel* model) {
  for (size_t i = 0; i < points.size(); ++i) {
    ColmapModel::Point& point = (*tracks)[i];
    point.id = static_cast<int>(i) + 1;
    if (point.track.size() < 2) {  // seen from culled keyframes
      for (const auto& [image, feature] : point.track)
        model->images[static_cast<size_t>(image) - 1].features[static_cast<size_t>(feature)].point = -1;
      continue;
    }
    const PointFit fit(*model, views, point);
    point.position = fit.Refine(points[i].position);
    point.error = fit.MeanError(point.position);
    point.color = points[i].color;
    model->points.push_back(std::move(point));
  }
}

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
  std::vector<View> views;
  for (const SnapshotKeyframe& placed : snapshot.components[component].keyframes) {
    const SnapshotSubmap& submap = snapshot.submaps[placed.submap];
    const SubmapKeyframe& keyframe = submap.submap->keyframes.at(placed.id);
    const SessionStarted& session = snapshot.model->GetSession(submap.key.session).info;
    const auto picture = pictures.find({submap.key.session, placed.id});
    const bool has_picture = picture != pictures.end();
    const ImagePixels pixels(session.camera, session.pinhole,
                             has_picture ? picture->second.width : session.pinhole.width,
                             has_picture ? picture->second.height : session.pinhole.height);
    views.emplace_back(pixels, placed.cam_from_root);
    const View& view = views.back();
    ColmapModel::Image image;
    image.id = static_cast<int>(model.images.size()) + 1;
    image.camera = cameras.Add(submap.session, pixels.GetCamera());
    image.name =
        has_picture ? picture->second.name : ColmapPictureName(submap.session, keyframe.frame, ImageSuffix("jpeg"));
    image.cam_from_world = placed.cam_from_root;
    for (int i = 0; i < keyframe.features.Size(); ++i) {
      const Eigen::Vector2d pixel =
          view.Project(session.pinhole.Unproject(keyframe.features.keypoints[i].pixel.cast<double>()));
      ColmapModel::Feature feature{pixel.x() + 0.5, pixel.y() + 0.5, -1};
      const MapPointId id = keyframe.map_points[i];
      const int point = id.IsValid() ? resolver.Find(submap.key.session, id) : -1;
      if (point >= 0) {
        const auto projected = view.ProjectPoint(points[point].position);
        ColmapModel::Point& track = tracks[point];
        // A picture sees a point once.
        const bool is_seen = !track.track.empty() && track.track.back().image == image.id;
        if (projected && (*projected - pixel).norm() <= max_error && !is_seen) {
          feature.point = point + 1;
          track.track.push_back({image.id, i});
        }
      }
      image.features.push_back(feature);
    }
    model.images.push_back(std::move(image));
  }
  ListPoints(points, views, &tracks, &model);
  return model;
}

}  // namespace mapmend
