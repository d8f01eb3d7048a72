#include "procs/mosaic/tile_frames.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "libs/base/degree.h"
#include "libs/base/median.h"
#include "libs/map_view/image_pixels.h"
#include "libs/map_view/level_frame.h"
#include "libs/mosaic/ground_scene.h"

namespace mapmend {
namespace {

using Json = nlohmann::json;

Eigen::Vector2d ToMercator(const Geodetic& place) {
  return {kMercatorRadius * place.longitude_deg * kDegree,
          kMercatorRadius * std::asinh(std::tan(place.latitude_deg * kDegree))};
}

// What a component's cameras see, roughly, in a frame with z up.
struct Overview {
  double gsd = 0;  // of an image's pixel, median; negative below the ground
  GroundBounds bounds;
};

Overview LookAt(const Snapshot& snapshot, int index, const MapPart& part, const Similarity3& ground_from_root) {
  std::vector<double> ground, gsds;
  for (const Eigen::Vector3d& point : part.points) ground.push_back((ground_from_root * point).z());
  Overview overview;
  const SnapshotComponent& component = snapshot.components[index];
  if (ground.empty() || component.keyframes.empty()) return overview;
  const double level = Median(std::move(ground));
  std::vector<Eigen::Vector2d> corners;
  for (const SnapshotKeyframe& keyframe : component.keyframes) {
    const Eigen::Vector3d center = ground_from_root * keyframe.cam_from_root.Center();
    const SessionStarted& info = snapshot.model->GetSession(snapshot.submaps[keyframe.submap].key.session).info;
    const Camera lens = LensOf(info.camera, info.pinhole);
    const double height = center.z() - level, focal = lens.Ideal().fx;
    gsds.push_back(height / focal);
    const double reach = std::abs(height) * std::max(lens.width, lens.height) / (2 * focal);
    corners.emplace_back(center.head<2>() - Eigen::Vector2d::Constant(reach));
    corners.emplace_back(center.head<2>() + Eigen::Vector2d::Constant(reach));
  }
  overview.gsd = Median(std::move(gsds));
  overview.bounds = BoundsOf(corners);
  return overview;
}

Similarity3 Moved(const Eigen::Vector2d& by) { return {1, Eigen::Quaterniond::Identity(), {by.x(), by.y(), 0}}; }

Similarity3 Scaled(double scale) { return {scale, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()}; }

Eigen::Vector3d UpOf(const Similarity3& ground_from_root) {
  return ground_from_root.rotation.conjugate() * Eigen::Vector3d::UnitZ();
}

bool Overlap(const GroundBounds& a, const GroundBounds& b) {
  return (a.high.array() > b.low.array()).all() && (a.low.array() < b.high.array()).all();
}

}  // namespace

Json ToJson(const GroundBounds& bounds) { return {bounds.low.x(), bounds.low.y(), bounds.high.x(), bounds.high.y()}; }

struct TileFrames::Inputs {
  const Snapshot& snapshot;
  const std::vector<MapPart>& parts;
  const WorldPlacement* world;

  bool IsOnEarth(int component) const {
    return world != nullptr && world->components[static_cast<size_t>(component)].success;
  }
};

std::vector<MapPart> PartsOf(const Snapshot& snapshot) {
  std::vector<MapPart> parts;
  for (int c = 0; c < static_cast<int>(snapshot.components.size()); ++c) {
    const SubmapKey& root = snapshot.submaps[snapshot.components[c].root].key;
    MapPart part{root.session + ":" + std::to_string(root.submap.value), {}};
    for (const ColoredPoint& point : ComponentPoints(snapshot, c)) part.points.push_back(point.position);
    parts.push_back(std::move(part));
  }
  return parts;
}

TileFrames::TileFrames(const TileFrameOptions& options, const std::string& text) : options_(options) {
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object()) return;
  try {
    std::map<std::string, Frame> frames;
    for (const auto& [name, entry] : json.at("frames").items()) {
      const auto transform = entry.at("ground_from_root").get<std::array<double, 8>>();
      const auto bounds = entry.at("bounds").get<std::array<double, 4>>();
      frames[name] = {entry.at("on_earth").get<bool>(),
                      SimilarityFromArray(transform.data()),
                      {{bounds[0], bounds[1]}, {bounds[2], bounds[3]}}};
    }
    const auto plane = json.at("plane").get<std::array<double, 4>>();
    is_on_earth_ = json.at("on_earth").get<bool>();
    main_ = json.at("main").get<std::string>();
    zoom_ = json.at("zoom").get<int>();
    plane_ = {{plane[0], plane[1]}, {plane[2], plane[3]}};
    frames_ = std::move(frames);
  } catch (const Json::exception&) {
    zoom_ = 0;  // as if there were nothing
  }
}

std::string TileFrames::ToText() const {
  Json frames = Json::object();
  for (const auto& [name, frame] : frames_) {
    frames[name] = {{"on_earth", frame.is_on_earth},
                    {"ground_from_root", ToArray(frame.ground_from_root)},
                    {"bounds", ToJson(frame.bounds)}};
  }
  return Json({{"on_earth", is_on_earth_},
               {"zoom", zoom_},
               {"main", main_},
               {"plane", {plane_.scale.x(), plane_.scale.y(), plane_.offset.x(), plane_.offset.y()}},
               {"frames", frames}})
      .dump();
}

const TileFrames::Frame* TileFrames::Find(const std::string& name) const {
  const auto it = frames_.find(name);
  return it == frames_.end() ? nullptr : &it->second;
}

// In metres on the earth; else level, with pixels of the size of the finest tiles', the first camera at the origin.
std::optional<TileFrames::Frame> TileFrames::Fresh(const Inputs& inputs, int component) const {
  Frame frame;
  frame.is_on_earth = inputs.IsOnEarth(component);
  if (frame.is_on_earth) {
    frame.ground_from_root = inputs.world->components[static_cast<size_t>(component)].enu_from_map;
  } else {
    Snapshot levelled;  // what is needed of it, and nothing else is copied
    levelled.model = inputs.snapshot.model;
    levelled.submaps = inputs.snapshot.submaps;
    levelled.components = {inputs.snapshot.components[component]};
    PlaceLevel(0, &levelled);
    frame.ground_from_root = levelled.components[0].frame_from_root;
  }
  const MapPart& part = inputs.parts[static_cast<size_t>(component)];
  Overview overview = LookAt(inputs.snapshot, component, part, frame.ground_from_root);
  if (!(overview.gsd > 0)) return std::nullopt;
  if (!frame.is_on_earth) {
    const double scale = TilePixelSize(zoom_) / plane_.scale.x() / overview.gsd;
    frame.ground_from_root = Scaled(scale) * frame.ground_from_root;
    overview.bounds.low *= scale;
    overview.bounds.high *= scale;
  }
  frame.bounds = overview.bounds;
  return frame;
}

// The square of web maps is stretched to the north and the east in proportion to the latitude; around the middle of the
// map that is constant but for centimetres.
void TileFrames::ChoosePlane(const WorldPlacement& world, const GroundBounds& bounds, double gsd) {
  const Eigen::Vector2d middle = (bounds.low + bounds.high) / 2;
  const auto mercator = [&](double east, double north) {
    return ToMercator(world.frame.ToGeodetic({middle.x() + east, middle.y() + north, 0}));
  };
  constexpr double kStep = 10;  // metres
  plane_.scale = {(mercator(kStep, 0) - mercator(-kStep, 0)).x() / (2 * kStep),
                  (mercator(0, kStep) - mercator(0, -kStep)).y() / (2 * kStep)};
  plane_.offset = mercator(0, 0) - plane_.scale.cwiseProduct(middle);
  zoom_ = ZoomOf(std::max(gsd, options_.finest_gsd_m) * plane_.scale.x());
}

bool TileFrames::IsGood(const Frame& frame, const Frame& fresh, const SnapshotComponent& component) const {
  if (frame.is_on_earth != fresh.is_on_earth) return false;
  if (!fresh.is_on_earth) {
    const double scale = fresh.ground_from_root.scale / frame.ground_from_root.scale;
    const double tilt =
        std::acos(std::clamp(UpOf(frame.ground_from_root).dot(UpOf(fresh.ground_from_root)), -1.0, 1.0));
    return tilt <= options_.max_tilt_deg * kDegree && std::max(scale, 1 / scale) <= options_.max_coarser;
  }
  const double most = options_.max_shift_px * TilePixelSize(zoom_) / plane_.scale.x();
  return std::all_of(component.keyframes.begin(), component.keyframes.end(), [&](const SnapshotKeyframe& keyframe) {
    const Eigen::Vector3d center = keyframe.cam_from_root.Center();
    return (frame.ground_from_root * center - fresh.ground_from_root * center).norm() <= most;
  });
}

// East of what is there already, south of the main part.
void TileFrames::PlaceApart(Frame* frame) const {
  constexpr double kGap = 1024;  // pixels
  const double gap = kGap * TilePixelSize(zoom_) / plane_.scale.x();
  const GroundBounds& main = frames_.at(main_).bounds;
  double west = main.low.x();
  for (const auto& [name, other] : frames_) {
    if (name != main_ && !other.is_on_earth) west = std::max(west, other.bounds.high.x() + gap);
  }
  const Eigen::Vector2d north_west(west, main.low.y() - gap);
  const Eigen::Vector2d by = north_west - Eigen::Vector2d(frame->bounds.low.x(), frame->bounds.high.y());
  frame->ground_from_root = Moved(by) * frame->ground_from_root;
  frame->bounds.low += by;
  frame->bounds.high += by;
}

void TileFrames::Place(const Inputs& inputs, int component, Frames* before) {
  std::optional<Frame> fresh = Fresh(inputs, component);
  if (!fresh) return;
  const MapPart& part = inputs.parts[static_cast<size_t>(component)];
  const bool is_main = main_.empty();
  if (is_main) {
    main_ = part.name;
    const double gsd = LookAt(inputs.snapshot, component, part, fresh->ground_from_root).gsd;
    const double coarser = TilePixelSize(zoom_) / (gsd * plane_.scale.x());
    if (is_on_earth_ && (before->empty() || std::max(coarser, 1 / coarser) > options_.max_coarser)) {
      before->clear();
      ChoosePlane(*inputs.world, fresh->bounds, gsd);
    }
  }
  const auto known = before->find(part.name);
  const bool stays = known != before->end() && IsGood(known->second, *fresh, inputs.snapshot.components[component]);
  Frame frame = stays ? known->second : *fresh;
  if (stays) frame.bounds = LookAt(inputs.snapshot, component, part, frame.ground_from_root).bounds;  // it grows
  const bool is_apart = !is_main && !frame.is_on_earth;
  if (is_apart && (!stays || Overlap(frame.bounds, frames_.at(main_).bounds))) PlaceApart(&frame);
  frames_[part.name] = frame;
}

void TileFrames::Update(const Snapshot& snapshot, const std::vector<MapPart>& parts, const WorldPlacement* world,
                        bool is_fresh) {
  const Inputs inputs{snapshot, parts, world};
  std::vector<int> order(parts.size());
  std::iota(order.begin(), order.end(), 0);
  // What is on the earth first: it says where the rest may lie.
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return inputs.IsOnEarth(a) && !inputs.IsOnEarth(b); });
  const bool on_earth = !order.empty() && inputs.IsOnEarth(order.front());
  Frames before = std::exchange(frames_, {});
  if (is_fresh || on_earth != is_on_earth_ || zoom_ == 0) before.clear();
  is_on_earth_ = on_earth;
  main_.clear();
  if (!on_earth) {
    plane_ = {};
    zoom_ = options_.local_zoom;
  }
  for (const int component : order) Place(inputs, component, &before);
}

}  // namespace mapmend
