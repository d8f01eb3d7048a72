#include "tools/simulate/scene.h"

namespace mapmend::simulate {
namespace {

Solid MakePrism(const Eigen::Vector3d& center, const Eigen::Vector3d& size, double yaw) {
  const Eigen::Vector3d x(std::cos(yaw), std::sin(yaw), 0), y(-x.y(), x.x(), 0);
  Solid solid;
  const auto add = [&](const Eigen::Vector3d& normal, double half) {
    Face face;
    face.normal = normal;
    face.offset = normal.dot(center) + half;
    solid.faces.push_back(face);
  };
  add(x, size.x() / 2);
  add(-x, size.x() / 2);
  add(y, size.y() / 2);
  add(-y, size.y() / 2);
  const Eigen::Vector3d reach(std::abs(x.x()) * size.x() / 2 + std::abs(y.x()) * size.y() / 2,
                              std::abs(x.y()) * size.x() / 2 + std::abs(y.y()) * size.y() / 2, size.z() / 2);
  solid.low = center - reach;
  solid.high = center + reach;
  return solid;
}

}  // namespace

Solid MakeBox(const Eigen::Vector3d& center, const Eigen::Vector3d& size, double yaw) {
  Solid solid = MakePrism(center, size, yaw);
  for (const double sign : {1.0, -1.0}) {
    Face face;
    face.normal = {0, 0, sign};
    face.offset = sign * center.z() + size.z() / 2;
    solid.faces.push_back(face);
  }
  return solid;
}

Solid MakeHouse(const Eigen::Vector3d& center, const Eigen::Vector3d& size, double yaw, double roof_height) {
  Solid solid = MakePrism(center, size, yaw);
  const Eigen::Vector3d y(-std::sin(yaw), std::cos(yaw), 0);
  const Eigen::Vector3d ridge = center + Eigen::Vector3d(0, 0, size.z() / 2 + roof_height);
  for (const double sign : {1.0, -1.0}) {
    Face face;
    face.normal = (sign * y * roof_height + Eigen::Vector3d(0, 0, size.y() / 2)).normalized();
    face.offset = face.normal.dot(ridge);
    solid.faces.push_back(face);
  }
  solid.high.z() += roof_height;
  return solid;
}

void LayTexture(Face* face, int texture, const Eigen::Vector3d& origin, const Eigen::Vector3d& u,
                const Eigen::Vector3d& v, double texels_per_metre) {
  face->texture = texture;
  face->texels_per_metre = static_cast<float>(texels_per_metre);
  face->u = u * texels_per_metre;
  face->v = v * texels_per_metre;
  face->u0 = -face->u.dot(origin) - 0.5;
  face->v0 = -face->v.dot(origin) - 0.5;
}

}  // namespace mapmend::simulate
