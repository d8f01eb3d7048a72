#include "libs/formats/gltf.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "libs/formats/keyframe_outline.h"
#include "libs/formats/little_endian.h"

namespace mapmend {
namespace {

using Json = nlohmann::ordered_json;

// Numbers of the specification.
constexpr int kFloat = 5126, kUnsignedByte = 5121, kArrayBuffer = 34962;
constexpr int kModePoints = 0, kModeLines = 1;
constexpr Rgb kTreeColor = {46, 160, 67}, kConnectionColor = {140, 149, 159}, kLoopColor = {219, 109, 40};

struct Vertices {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Rgb> colors;

  void Add(const Eigen::Vector3d& position, const Rgb& color) {
    positions.push_back(position.cast<float>());
    colors.push_back(color);
  }
};

class GlbScene {
 public:
  explicit GlbScene(const PlacedMap& map);

  // A mesh of one primitive and its node; nothing if it has no vertices.
  void AddMesh(const std::string& name, int mode, const Vertices& vertices);
  void AddCameras(const PlacedMap& map);
  std::string Finish();

 private:
  int AddAccessor(const std::string& bytes, size_t count, Json accessor);
  void AddNode(Json node) {
    nodes_[0]["children"].push_back(nodes_.size());
    nodes_.push_back(std::move(node));
  }

  Json asset_, nodes_ = Json::array(), meshes_ = Json::array(), accessors_ = Json::array(), views_ = Json::array(),
               cameras_ = Json::array();
  std::string binary_;
};

GlbScene::GlbScene(const PlacedMap& map) {
  const Eigen::Vector3d& origin = map.frame.origin;
  asset_ = {{"version", "2.0"},
            {"generator", "mapmend " MAPMEND_VERSION},
            {"extras",
             {{"title", map.title},
              {"frame", map.frame.name},
              {"unit", map.frame.unit},
              {"description", Describe(map.frame)},
              {"origin", {origin.x(), origin.y(), origin.z()}}}}};
  if (map.frame.epsg > 0) asset_["extras"]["epsg"] = map.frame.epsg;
  const double s = std::sqrt(0.5);
  const Json turn = map.frame.is_z_up ? Json{-s, 0.0, 0.0, s} : Json{1.0, 0.0, 0.0, 0.0};
  nodes_.push_back({{"name", "map"}, {"rotation", turn}, {"children", Json::array()}});
}

int GlbScene::AddAccessor(const std::string& bytes, size_t count, Json accessor) {
  views_.push_back(
      {{"buffer", 0}, {"byteOffset", binary_.size()}, {"byteLength", bytes.size()}, {"target", kArrayBuffer}});
  binary_ += bytes;
  accessor["bufferView"] = views_.size() - 1;
  accessor["count"] = count;
  accessors_.push_back(std::move(accessor));
  return static_cast<int>(accessors_.size()) - 1;
}

void GlbScene::AddMesh(const std::string& name, int mode, const Vertices& vertices) {
  if (vertices.positions.empty()) return;
  std::string positions, colors;
  Eigen::Vector3f low = vertices.positions.front(), high = low;
  for (const Eigen::Vector3f& p : vertices.positions) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
    for (int i = 0; i < 3; ++i) Append(p[i], &positions);
  }
  for (const Rgb& color : vertices.colors) {
    for (const uint8_t c : color) Append(c, &colors);
    Append(uint8_t{255}, &colors);
  }
  const size_t count = vertices.positions.size();
  const int position = AddAccessor(positions, count,
                                   {{"componentType", kFloat},
                                    {"type", "VEC3"},
                                    {"min", {low.x(), low.y(), low.z()}},
                                    {"max", {high.x(), high.y(), high.z()}}});
  const int color =
      AddAccessor(colors, count, {{"componentType", kUnsignedByte}, {"normalized", true}, {"type", "VEC4"}});
  const Json primitive = {
      {"attributes", {{"POSITION", position}, {"COLOR_0", color}}}, {"mode", mode}, {"material", 0}};
  meshes_.push_back({{"name", name}, {"primitives", Json::array({primitive})}});
  AddNode({{"name", name}, {"mesh", meshes_.size() - 1}});
}

void GlbScene::AddCameras(const PlacedMap& map) {
  for (const Pinhole& camera : map.cameras) {
    cameras_.push_back({{"type", "perspective"},
                        {"perspective",
                         {{"yfov", 2 * std::atan(camera.height / (2 * camera.fy))},
                          {"aspectRatio", camera.width * camera.fy / (camera.height * camera.fx)},
                          {"znear", 0.01}}}});
  }
  for (const PlacedPose& keyframe : map.keyframes) {
    // glTF's cameras look along -z, with y up.
    const Eigen::Quaterniond q = keyframe.world_from_camera.rotation * Eigen::Quaterniond(0, 1, 0, 0);
    const Eigen::Vector3d& t = keyframe.world_from_camera.translation;
    AddNode({{"name", std::to_string(keyframe.session) + "/" + std::to_string(keyframe.frame)},
             {"camera", keyframe.session},
             {"rotation", {q.x(), q.y(), q.z(), q.w()}},
             {"translation", {t.x(), t.y(), t.z()}}});
  }
}

std::string GlbScene::Finish() {
  if (nodes_[0]["children"].empty()) nodes_[0].erase("children");
  Json json = {{"asset", asset_},
               {"scene", 0},
               {"scenes", Json::array({{{"name", "mapmend"}, {"nodes", {0}}}})},
               {"nodes", nodes_}};
  if (!cameras_.empty()) json["cameras"] = cameras_;
  if (!meshes_.empty()) {
    json["extensionsUsed"] = {"KHR_materials_unlit"};
    json["materials"] = Json::array({{{"name", "colours"},
                                      {"pbrMetallicRoughness", {{"metallicFactor", 0.0}, {"roughnessFactor", 1.0}}},
                                      {"extensions", {{"KHR_materials_unlit", Json::object()}}}}});
    json["meshes"] = meshes_;
    json["accessors"] = accessors_;
    json["bufferViews"] = views_;
    json["buffers"] = Json::array({{{"byteLength", binary_.size()}}});
  }
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.append((4 - text.size() % 4) % 4, ' ');
  std::string chunks;
  Append(static_cast<uint32_t>(text.size()), &chunks);
  chunks += "JSON" + text;
  if (!binary_.empty()) {  // of floats and groups of four bytes: aligned
    Append(static_cast<uint32_t>(binary_.size()), &chunks);
    chunks += std::string("BIN\0", 4) + binary_;
  }
  std::string glb = "glTF";
  Append(uint32_t{2}, &glb);
  Append(static_cast<uint32_t>(12 + chunks.size()), &glb);
  return glb + chunks;
}

Vertices Path(const PlacedMap& map) {
  Vertices lines;
  for (size_t i = 0; i + 1 < map.frames.size(); ++i) {
    const PlacedPose &from = map.frames[i], &to = map.frames[i + 1];
    if (from.session != to.session || to.frame != from.frame + 1) continue;  // frames are missing in between
    for (const PlacedPose* end : {&from, &to})
      lines.Add(end->world_from_camera.translation, map.submaps[from.submap].color);
  }
  return lines;
}

Vertices Outlines(const PlacedMap& map) {
  Vertices lines;
  const double depth = OutlineDepth(map);
  for (const PlacedPose& keyframe : map.keyframes) {
    for (const Eigen::Vector3d& end : KeyframeOutline(map, keyframe, depth))
      lines.Add(end, map.submaps[keyframe.submap].color);
  }
  return lines;
}

Vertices Connections(const PlacedMap& map) {
  Vertices lines;
  for (const PlacedRelation& relation : map.relations) {
    if (relation.kind == PlacedRelation::Kind::kTracked) continue;
    const Rgb& color = relation.kind == PlacedRelation::Kind::kTree   ? kTreeColor
                       : relation.kind == PlacedRelation::Kind::kLoop ? kLoopColor
                                                                      : kConnectionColor;
    for (const int end : {relation.a, relation.b}) lines.Add(map.keyframes[end].world_from_camera.translation, color);
  }
  return lines;
}

}  // namespace

std::string MapGlb(const PlacedMap& map) {
  GlbScene scene(map);
  Vertices points;
  for (const PlacedPoint& point : map.points) points.Add(point.position, point.color);
  scene.AddMesh("points", kModePoints, points);
  scene.AddMesh("camera path", kModeLines, Path(map));
  scene.AddMesh("keyframes", kModeLines, Outlines(map));
  scene.AddMesh("connections", kModeLines, Connections(map));
  scene.AddCameras(map);
  return scene.Finish();
}

}  // namespace mapmend
