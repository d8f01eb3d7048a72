#include "libs/formats/map_mcap.h"

#include <algorithm>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "libs/formats/base64.h"
#include "libs/formats/foxglove_schemas.h"
#include "libs/formats/keyframe_outline.h"
#include "libs/formats/little_endian.h"
#include "libs/formats/mcap_writer.h"

namespace mapmend {
namespace {

using Json = nlohmann::ordered_json;

// Numbers of Foxglove's enumerations.
constexpr int kUint8 = 1, kFloat32 = 7, kLineStrip = 0, kLineList = 2, kInfo = 2, kWarning = 3;

Json Time(int64_t utime) { return {{"sec", utime / 1000000}, {"nsec", utime % 1000000 * 1000}}; }
Json Vector(const Eigen::Vector3d& v) { return {{"x", v.x()}, {"y", v.y()}, {"z", v.z()}}; }
Json Quaternion(const Eigen::Quaterniond& q) { return {{"x", q.x()}, {"y", q.y()}, {"z", q.z()}, {"w", q.w()}}; }
Json Pose(const Rigid3& pose) {
  return {{"position", Vector(pose.translation)}, {"orientation", Quaternion(pose.rotation)}};
}
Json Color(const Rgb& c) { return {{"r", c[0] / 255.0}, {"g", c[1] / 255.0}, {"b", c[2] / 255.0}, {"a", 1.0}}; }

class MapRecording {
 public:
  MapRecording(const PlacedMap& map, std::ostream* stream)
      : map_(map), writer_(stream), start_(map.frames.empty() ? 0 : map.frames.front().utime) {}

  void Write();

 private:
  // With time and frame, which nearly all messages begin with.
  Json Stamped(int64_t utime) const { return {{"timestamp", Time(utime)}, {"frame_id", map_.frame.name}}; }
  uint16_t Open(const std::string& topic, const std::string& schema) {
    const std::string name = "foxglove." + schema;
    return writer_.AddChannel(topic, name, FoxgloveSchema(name));
  }
  void Add(uint16_t channel, int64_t utime, const Json& message) {
    writer_.AddMessage(channel, static_cast<uint64_t>(std::max<int64_t>(utime, 0)) * 1000,
                       message.dump(-1, ' ', false, Json::error_handler_t::replace));
  }
  Json Points() const;
  Json Path() const;
  Json Entity(const std::string& id, int type, const Rgb& color, const Json& points) const;
  Json Graph() const;
  Json Calibration(const PlacedPose& frame) const;
  Json LogMessage(int64_t utime, int level, const std::string& text) const;

  const PlacedMap& map_;
  McapWriter writer_;
  const int64_t start_;
};

Json MapRecording::Points() const {
  std::string data;
  for (const PlacedPoint& point : map_.points) {
    for (int i = 0; i < 3; ++i) Append(static_cast<float>(point.position[i]), &data);
    for (const uint8_t c : point.color) Append(c, &data);
    Append(uint8_t{255}, &data);
  }
  Json fields = Json::array();
  for (const char* axis : {"x", "y", "z"})
    fields.push_back({{"name", axis}, {"offset", 4 * fields.size()}, {"type", kFloat32}});
  for (const char* color : {"red", "green", "blue", "alpha"})
    fields.push_back({{"name", color}, {"offset", 9 + fields.size()}, {"type", kUint8}});
  Json message = Stamped(start_);
  message["pose"] = Pose(Rigid3());
  message["point_stride"] = 16;
  message["fields"] = fields;
  message["data"] = Base64(data);
  return message;
}

Json MapRecording::Path() const {
  Json message = Stamped(start_);
  message["poses"] = Json::array();
  for (const PlacedPose& frame : map_.frames) message["poses"].push_back(Pose(frame.world_from_camera));
  return message;
}

Json MapRecording::Entity(const std::string& id, int type, const Rgb& color, const Json& points) const {
  const Json line = {
      {"type", type},     {"pose", Pose(Rigid3())}, {"thickness", 1.5},        {"scale_invariant", true},
      {"points", points}, {"color", Color(color)},  {"colors", Json::array()}, {"indices", Json::array()}};
  Json entity = Stamped(start_);
  entity["id"] = id;
  entity["lifetime"] = Time(0);  // for ever
  entity["frame_locked"] = false;
  entity["metadata"] = Json::array();
  entity["lines"] = Json::array({line});
  for (const char* other : {"arrows", "cubes", "spheres", "cylinders", "triangles", "texts", "models"})
    entity[other] = Json::array();
  return entity;
}

Json MapRecording::Graph() const {
  Json entities = Json::array();
  const double depth = OutlineDepth(map_);
  std::map<int, Json> outlines, paths;  // by submap
  for (const PlacedPose& keyframe : map_.keyframes) {
    for (const Eigen::Vector3d& end : KeyframeOutline(map_, keyframe, depth))
      outlines[keyframe.submap].push_back(Vector(end));
    paths[keyframe.submap].push_back(Vector(keyframe.world_from_camera.translation));
  }
  for (const auto& [submap, points] : outlines) {
    const std::string name = "submap " + std::to_string(map_.submaps[submap].number);
    entities.push_back(Entity(name + " keyframes", kLineList, map_.submaps[submap].color, points));
    entities.push_back(Entity(name + " path", kLineStrip, map_.submaps[submap].color, paths[submap]));
  }
  std::map<PlacedRelation::Kind, Json> lines;
  for (const PlacedRelation& relation : map_.relations) {
    if (relation.kind == PlacedRelation::Kind::kTracked) continue;
    for (const int end : {relation.a, relation.b})
      lines[relation.kind].push_back(Vector(map_.keyframes[end].world_from_camera.translation));
  }
  for (const auto& [kind, points] : lines) {
    const bool is_tree = kind == PlacedRelation::Kind::kTree, is_loop = kind == PlacedRelation::Kind::kLoop;
    entities.push_back(Entity(is_tree   ? "tree"
                              : is_loop ? "loops"
                                        : "other connections",
                              kLineList,
                              is_tree   ? Rgb{46, 160, 67}
                              : is_loop ? Rgb{219, 109, 40}
                                        : Rgb{140, 149, 159},
                              points));
  }
  return {{"deletions", Json::array()}, {"entities", entities}};
}

Json MapRecording::Calibration(const PlacedPose& frame) const {
  const Pinhole& c = map_.cameras[frame.session];
  return {{"timestamp", Time(frame.utime)},
          {"frame_id", "camera"},
          {"width", c.width},
          {"height", c.height},
          {"distortion_model", ""},
          {"D", Json::array()},
          {"K", {c.fx, 0.0, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0}},
          {"R", {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}},
          {"P", {c.fx, 0.0, c.cx, 0.0, 0.0, c.fy, c.cy, 0.0, 0.0, 0.0, 1.0, 0.0}}};
}

Json MapRecording::LogMessage(int64_t utime, int level, const std::string& text) const {
  return {{"timestamp", Time(utime)}, {"level", level}, {"message", text},
          {"name", "mapmend"},        {"file", ""},     {"line", 0}};
}

void MapRecording::Write() {
  const uint16_t log = Open("/log", "Log");
  Add(log, start_, LogMessage(start_, kInfo, map_.title + ": " + Describe(map_.frame)));
  Add(Open("/map/points", "PointCloud"), start_, Points());
  Add(Open("/map/path", "PosesInFrame"), start_, Path());
  Add(Open("/map/graph", "SceneUpdate"), start_, Graph());
  const uint16_t camera = Open("/map/camera", "PoseInFrame"), tf = Open("/tf", "FrameTransform"),
                 info = Open("/camera/info", "CameraCalibration");
  auto loss = map_.losses.begin();
  const auto tell_losses = [&](int64_t until) {
    for (; loss != map_.losses.end() && loss->utime < until; ++loss)
      Add(log, loss->utime, LogMessage(loss->utime, kWarning, loss->text));
  };
  for (const PlacedPose& frame : map_.frames) {
    tell_losses(frame.utime);
    Json pose = Stamped(frame.utime);
    pose["pose"] = Pose(frame.world_from_camera);
    Add(camera, frame.utime, pose);
    Add(tf, frame.utime,
        {{"timestamp", Time(frame.utime)},
         {"parent_frame_id", map_.frame.name},
         {"child_frame_id", "camera"},
         {"translation", Vector(frame.world_from_camera.translation)},
         {"rotation", Quaternion(frame.world_from_camera.rotation)}});
    Add(info, frame.utime, Calibration(frame));
  }
  tell_losses(std::numeric_limits<int64_t>::max());
  writer_.Finish();
}

}  // namespace

void WriteMcap(const PlacedMap& map, std::ostream* stream) { MapRecording(map, stream).Write(); }

}  // namespace mapmend
