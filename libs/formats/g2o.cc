#include "libs/formats/g2o.h"

#include <utility>

#include "libs/base/text_format.h"

namespace mapmend {
namespace {

std::string Numbers(const Rigid3& pose) {
  const auto v = ToArray(pose);
  return Format("%.12g %.12g %.12g %.12g %.12g %.12g %.12g", v[0], v[1], v[2], v[3], v[4], v[5], v[6]);
}

// The upper triangle, row by row.
std::string Information(const PlacedRelation& relation) {
  const double translation = 1 / (relation.sigma_translation * relation.sigma_translation);
  const double rotation = 4 / (relation.sigma_rotation * relation.sigma_rotation);
  std::string text;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column)
      text += column > row ? " 0" : Format(" %.9g", row < 3 ? translation : rotation);
  }
  return text;
}

}  // namespace

std::string PoseGraphG2o(const PlacedMap& map) {
  std::string text = "# mapmend: " + map.title + "\n# " + Describe(map.frame) + "\n# keyframes, world_from_camera\n";
  for (size_t i = 0; i < map.keyframes.size(); ++i) {
    Rigid3 pose = map.keyframes[i].world_from_camera;
    pose.translation += map.frame.origin;
    text += "VERTEX_SE3:QUAT " + std::to_string(i) + " " + Numbers(pose) + "\n";
  }
  if (!map.keyframes.empty()) text += "FIX 0\n";
  using Kind = PlacedRelation::Kind;
  for (const auto& [kind, name] : {std::pair(Kind::kTracked, "as tracked"), std::pair(Kind::kTree, "tree"),
                                   std::pair(Kind::kConnection, "connections that are not in the tree"),
                                   std::pair(Kind::kLoop, "loops within a submap")}) {
    bool is_first = true;
    for (const PlacedRelation& relation : map.relations) {
      if (relation.kind != kind) continue;
      if (std::exchange(is_first, false)) text += std::string("# ") + name + "\n";
      text += Format("EDGE_SE3:QUAT %d %d ", relation.a, relation.b) + Numbers(relation.a_from_b) +
              Information(relation) + "\n";
    }
  }
  return text;
}

}  // namespace mapmend
