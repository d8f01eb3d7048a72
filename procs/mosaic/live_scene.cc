#include "procs/mosaic/live_scene.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "libs/base/text_format.h"
#include "libs/map_view/image_pixels.h"
#include "libs/mosaic/brightness.h"

namespace mapmend {
namespace {

// West, south, east, north in degrees, as MBTiles want them.
std::string DegreesText(const GroundBounds& on_square) {
  const auto longitude = [](double x) { return x / kMercatorRadius * 180 / M_PI; };
  const auto latitude = [](double y) { return std::atan(std::sinh(y / kMercatorRadius)) * 180 / M_PI; };
  return Format("%.9f,%.9f,%.9f,%.9f", longitude(on_square.low.x()), latitude(on_square.low.y()),
                longitude(on_square.high.x()), latitude(on_square.high.y()));
}

}  // namespace

LiveScene::LiveScene(const LiveSceneOptions& options, const std::string& frames)
    : options_(options), frames_(options.frames, frames), exposure_(options.exposure) {}

std::optional<TileComponent> LiveScene::MakeComponent(const Snapshot& snapshot, int index, const MapPart& part,
                                                      const KnownImages& images, bool is_final) {
  const TileFrames::Frame* frame = frames_.Find(part.name);
  if (frame == nullptr) return std::nullopt;
  std::vector<MosaicImage> shown;
  std::vector<cv::Mat> brightness;
  const std::vector<ReadoutMove> moves = ReadoutMoves(snapshot, index, shutters_);
  const std::vector<SnapshotKeyframe>& keyframes = snapshot.components[index].keyframes;
  for (size_t i = 0; i < keyframes.size(); ++i) {
    const SnapshotKeyframe& keyframe = keyframes[i];
    const std::string& session = snapshot.submaps[keyframe.submap].key.session;
    const int id = images.Find({session, keyframe.id.value});
    if (id < 0) continue;
    const KnownImages::Image& image = images.Get(id);
    const SessionStarted& info = snapshot.model->GetSession(session).info;
    MosaicImage one{LensOf(info.camera, info.pinhole).Resized(image.width, image.height),
                    TransformWorld(keyframe.cam_from_root, frame->ground_from_root)};
    one.id = id;
    one.was_leading = !is_final && leading_.contains({part.name, id});
    const auto shutter = shutters_.find(session);
    if (shutter != shutters_.end())
      one.motion = {frame->ground_from_root.scale * moves[i].shift, moves[i].turn, shutter->second.by_columns};
    shown.push_back(std::move(one));
    brightness.push_back(image.brightness);
  }
  if (shown.empty()) return std::nullopt;
  std::vector<Eigen::Vector3d> points;
  points.reserve(part.points.size());
  for (const Eigen::Vector3d& point : part.points) points.push_back(frame->ground_from_root * point);
  TileComponent component{part.name, index == 0, GroundScene(options_.ground, std::move(shown), points)};
  if (index == 0) problem_ = component.scene.Problem();
  if (!component.scene.Problem().empty()) return std::nullopt;
  SetClippedAside(brightness, &component.scene);
  for (int i = 0; i < component.scene.NumImages(); ++i) {
    if (component.scene.IsLeading(i)) leading_.emplace(part.name, component.scene.Image(i).id);
  }
  exposure_.Apply(part.name, brightness, is_final, &component.scene);
  return component;
}

TileScene LiveScene::Make(const Snapshot& snapshot, const KnownImages& images, bool is_final) {
  const std::optional<WorldPlacement> world = PlaceOnEarth(snapshot, options_.placement);
  const std::vector<MapPart> parts = PartsOf(snapshot);
  // Refinements while it flies know of none.
  shutters_ = is_final ? FindShutters(snapshot) : std::map<std::string, FoundShutter>();
  frames_.Update(snapshot, parts, world && world->problem.empty() ? &*world : nullptr, is_final);
  TileScene scene;
  scene.zoom = frames_.Zoom();
  scene.plane = frames_.Plane();
  problem_ = parts.empty() ? "nothing is mapped yet" : "no images of keyframes are stored";
  int64_t newest = -1;
  for (size_t c = 0; c < parts.size(); ++c) {
    auto component = MakeComponent(snapshot, static_cast<int>(c), parts[c], images, is_final);
    if (!component) continue;
    const SnapshotKeyframe& last = snapshot.components[c].keyframes.back();
    if (last.utime > newest) {
      newest = last.utime;
      focus_ = (frames_.Find(parts[c].name)->ground_from_root * last.cam_from_root.Center()).head<2>();
    }
    scene.components.push_back(std::move(*component));
  }
  return scene;
}

std::map<std::string, std::string> LiveScene::Metadata(const TileScene& scene) const {
  nlohmann::json components = nlohmann::json::array();
  std::vector<Eigen::Vector2d> corners;
  for (const TileComponent& component : scene.components) {
    const TileFrames::Frame& frame = *frames_.Find(component.name);
    const GroundBounds bounds = scene.plane.ToTiles(component.scene.Bounds());
    corners.push_back(bounds.low);
    corners.push_back(bounds.high);
    components.push_back({{"root", component.name},
                          {"joined", component.is_joined},
                          {"on_earth", frame.is_on_earth},
                          {"ground_from_map", ToArray(frame.ground_from_root)},
                          {"bounds", ToJson(bounds)}});
  }
  const GroundBounds all = BoundsOf(corners);
  const Eigen::Vector2d &scale = scene.plane.scale, &offset = scene.plane.offset;
  std::map<std::string, std::string> metadata = {
      {"name", "mapmend"},
      {"description", "the ground as mapped, each place from the image that shows it best"},
      {"type", "baselayer"},
      {"version", "1"},
      {"format", "png"},
      {"bounds", DegreesText(all)},
      {"maxzoom", std::to_string(scene.zoom)},
      {"frame", frames_.IsOnEarth() ? "EPSG:3857" : "local"},
      {"unit", frames_.IsOnEarth() ? "m" : "map units"},
      {"tiles_from_ground", Format("%.17g %.17g %.17g %.17g", scale.x(), scale.y(), offset.x(), offset.y())},
      {"components", components.dump()},
      {"problem", problem_},
      {"mapmend_frames", frames_.ToText()}};
  return metadata;
}

}  // namespace mapmend
