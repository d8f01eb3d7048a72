#include <bit>
#include <cstdint>
#include <cstdio>
#include <type_traits>

#include "procs/viewer_export/colmap_model.h"

namespace mapmend {
namespace {

template <typename... Args>
std::string Print(const char* format, Args... args) {
  char text[512];
  std::snprintf(text, sizeof(text), format, args...);
  return text;
}

// Numbers as they lie in memory.
class Binary {
 public:
  template <typename T>
  void Add(T value) {
    static_assert(std::endian::native == std::endian::little && std::is_trivially_copyable_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(value));
  }
  void AddText(const std::string& text) { bytes_.append(text.c_str(), text.size() + 1); }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

}  // namespace

ColmapFiles ToColmapText(const ColmapModel& model) {
  ColmapFiles files;
  files.cameras = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
  for (size_t c = 0; c < model.cameras.size(); ++c) {
    const ColmapCamera& camera = model.cameras[c];
    files.cameras += Print("%zu %s %d %d", c + 1, camera.model.c_str(), camera.width, camera.height);
    for (const double param : camera.params) files.cameras += Print(" %.12g", param);
    files.cameras += "\n";
  }
  files.images = "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n";
  for (const ColmapModel::Image& image : model.images) {
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    const Eigen::Vector3d& t = image.cam_from_world.translation;
    files.images += Print("%d %.12g %.12g %.12g %.12g %.12g %.12g %.12g %d ", image.id, q.w(), q.x(), q.y(), q.z(),
                          t.x(), t.y(), t.z(), image.camera) +
                    image.name + "\n";
    for (size_t i = 0; i < image.features.size(); ++i) {
      const ColmapModel::Feature& f = image.features[i];
      files.images += Print("%s%.3f %.3f %d", i == 0 ? "" : " ", f.x, f.y, f.point);
    }
    files.images += "\n";
  }
  files.points = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n";
  for (const ColmapModel::Point& point : model.points) {
    const Eigen::Vector3d& p = point.position;
    files.points += Print("%d %.9g %.9g %.9g %d %d %d %.4f", point.id, p.x(), p.y(), p.z(), point.color[0],
                          point.color[1], point.color[2], point.error);
    for (const auto& [image, feature] : point.track) files.points += Print(" %d %d", image, feature);
    files.points += "\n";
  }
  return files;
}

ColmapFiles ToColmapBinary(const ColmapModel& model) {
  Binary cameras, images, points;
  cameras.Add(static_cast<uint64_t>(model.cameras.size()));
  for (size_t c = 0; c < model.cameras.size(); ++c) {
    const ColmapCamera& camera = model.cameras[c];
    cameras.Add(static_cast<int32_t>(c + 1));
    cameras.Add(static_cast<int32_t>(camera.model_id));
    cameras.Add(static_cast<uint64_t>(camera.width));
    cameras.Add(static_cast<uint64_t>(camera.height));
    for (const double param : camera.params) cameras.Add(param);
  }
  images.Add(static_cast<uint64_t>(model.images.size()));
  for (const ColmapModel::Image& image : model.images) {
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    images.Add(static_cast<int32_t>(image.id));
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) images.Add(value);
    for (int i = 0; i < 3; ++i) images.Add(image.cam_from_world.translation[i]);
    images.Add(static_cast<int32_t>(image.camera));
    images.AddText(image.name);
    images.Add(static_cast<uint64_t>(image.features.size()));
    for (const ColmapModel::Feature& f : image.features) {
      images.Add(f.x);
      images.Add(f.y);
      images.Add(static_cast<int64_t>(f.point));
    }
  }
  points.Add(static_cast<uint64_t>(model.points.size()));
  for (const ColmapModel::Point& point : model.points) {
    points.Add(static_cast<uint64_t>(point.id));
    for (int i = 0; i < 3; ++i) points.Add(point.position[i]);
    for (const uint8_t channel : point.color) points.Add(channel);
    points.Add(point.error);
    points.Add(static_cast<uint64_t>(point.track.size()));
    for (const auto& [image, feature] : point.track) {
      points.Add(static_cast<int32_t>(image));
      points.Add(static_cast<int32_t>(feature));
    }
  }
  return {cameras.Take(), images.Take(), points.Take()};
}

}  // namespace mapmend
