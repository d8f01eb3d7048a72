#include "libs/formats/gltf.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/unit/formats/byte_reader.h"
#include "tests/unit/formats/test_map.h"

namespace mapmend {
namespace gltf_test {

using Json = nlohmann::json;

struct Glb {
  Json json;
  std::string binary;

  const Json& Node(const std::string& name) const {
    for (const Json& node : json.at("nodes")) {
      if (node.at("name") == name) return node;
    }
    throw std::runtime_error("no node " + name);
  }
  const Json& Primitive(const std::string& node) const {
    return json.at("meshes").at(Node(node).at("mesh").get<int>()).at("primitives").at(0);
  }
  // Positions of a mesh in its own coordinates.
  std::vector<Eigen::Vector3f> Positions(const std::string& node) const {
    const Json& accessor = json.at("accessors").at(Primitive(node).at("attributes").at("POSITION").get<int>());
    const Json& view = json.at("bufferViews").at(accessor.at("bufferView").get<int>());
    ByteReader in(binary, view.at("byteOffset"));
    EXPECT_EQ(view.at("byteLength"), accessor.at("count").get<size_t>() * 12);
    std::vector<Eigen::Vector3f> positions;
    for (size_t i = 0; i < accessor.at("count"); ++i) {
      Eigen::Vector3f p;
      for (int axis = 0; axis < 3; ++axis) {
        p[axis] = in.Take<float>();
        EXPECT_GE(p[axis], accessor.at("min").at(axis).get<float>());
        EXPECT_LE(p[axis], accessor.at("max").at(axis).get<float>());
      }
      positions.push_back(p);
    }
    return positions;
  }
};

Eigen::Quaterniond Rotation(const Json& node) {
  const Json& q = node.at("rotation");
  return {q.at(3).get<double>(), q.at(0).get<double>(), q.at(1).get<double>(), q.at(2).get<double>()};
}

Glb Read(const std::string& bytes) {
  Glb glb;
  ByteReader in(bytes);
  EXPECT_EQ(in.Bytes(4), "glTF");
  EXPECT_EQ(in.Take<uint32_t>(), 2u);
  EXPECT_EQ(in.Take<uint32_t>(), bytes.size());
  const auto json_size = in.Take<uint32_t>();
  EXPECT_EQ(json_size % 4, 0u);
  EXPECT_EQ(in.Bytes(4), "JSON");
  glb.json = Json::parse(in.Bytes(json_size));
  if (in.AtEnd()) return glb;
  const auto size = in.Take<uint32_t>();
  EXPECT_EQ(size % 4, 0u);
  EXPECT_EQ(in.Bytes(4), std::string("BIN\0", 4));
  glb.binary = in.Bytes(size);
  EXPECT_TRUE(in.AtEnd());
  EXPECT_EQ(glb.json.at("buffers").at(0).at("byteLength"), size);
  return glb;
}

TEST(Gltf, PointsPathAndConnectionsAreWhereTheMapHasThem) {
  const PlacedMap map = MakeTestMap();
  const Glb glb = Read(MapGlb(map));
  const auto points = glb.Positions("points");
  ASSERT_EQ(points.size(), 6u);
  for (size_t i = 0; i < 6; ++i) EXPECT_LT((points[i].cast<double>() - map.points[i].position).norm(), 1e-6);
  EXPECT_EQ(glb.Primitive("points").at("mode"), 0);
  EXPECT_EQ(glb.Positions("camera path").size(), 8u) << "two lines in each submap, none across the missing frames";
  EXPECT_EQ(glb.Positions("connections").size(), 4u) << "what was only tracked is no connection";
  const auto outlines = glb.Positions("keyframes");
  ASSERT_EQ(outlines.size(), 48u);
  EXPECT_LT((outlines[0].cast<double>() - map.keyframes[0].world_from_camera.translation).norm(), 1e-6);
  EXPECT_NEAR(outlines[1].z(), 8, 1e-5) << "half the way between keyframes below them";
}

TEST(Gltf, CamerasLookAlongMinusZAndUpIsY) {
  for (const PlacedMap& map : {MakeTestMap(), MakeUtmMap()}) {
    const Glb glb = Read(MapGlb(map));
    const Json& node = glb.Node("0/9");  // the last keyframe
    const Eigen::Vector3d view = Rotation(node) * Eigen::Vector3d(0, 0, -1);
    EXPECT_LT((view - map.keyframes[2].world_from_camera.rotation * Eigen::Vector3d::UnitZ()).norm(), 1e-9);
    const Eigen::Vector3d top = Rotation(node) * Eigen::Vector3d::UnitY();
    EXPECT_LT((top + map.keyframes[2].world_from_camera.rotation * Eigen::Vector3d::UnitY()).norm(), 1e-9);
    // Up of the map is glTF's y.
    const Eigen::Vector3d up = map.frame.is_z_up ? Eigen::Vector3d(0, 0, 1) : Eigen::Vector3d(0, -1, 0);
    EXPECT_LT((Rotation(glb.Node("map")) * up - Eigen::Vector3d::UnitY()).norm(), 1e-9);
  }
  const Json camera = Read(MapGlb(MakeTestMap())).json.at("cameras").at(0).at("perspective");
  EXPECT_NEAR(camera.at("yfov").get<double>(), 2 * std::atan(240.0 / 500), 1e-12);
  EXPECT_NEAR(camera.at("aspectRatio").get<double>(), 640.0 / 480, 1e-12);
}

TEST(Gltf, TheFrameAndItsOriginAreTold) {
  const Json extras = Read(MapGlb(MakeUtmMap())).json.at("asset").at("extras");
  EXPECT_EQ(extras.at("epsg"), 32630);
  EXPECT_EQ(extras.at("origin").at(1), 5912345.0);
  EXPECT_EQ(Read(MapGlb(MakeTestMap())).json.at("asset").at("extras").at("unit"), "map units");
}

TEST(Gltf, AnEmptyMapHasNoMeshes) { EXPECT_FALSE(Read(MapGlb(PlacedMap())).json.contains("meshes")); }

}  // namespace gltf_test
}  // namespace mapmend
