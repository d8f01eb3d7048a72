#pragma once

#include <cmath>

#include "libs/formats/placed_map.h"

namespace mapmend {

// Two submaps of three frames each on a line, looking down from 10 units above six points; every second frame is a
// keyframe. All relations are true.
inline PlacedMap MakeTestMap() {
  PlacedMap map;
  map.title = "main map";
  Pinhole camera;
  camera.fx = camera.fy = 500;
  camera.cx = 319.5;
  camera.cy = 239.5;
  camera.width = 640;
  camera.height = 480;
  map.cameras = {camera};
  map.submaps = {{0, {200, 10, 20}}, {7, {10, 200, 20}}};
  const Eigen::Quaterniond down(0, 1, 0, 0);  // x as in the world, y and z turned round
  for (int i = 0; i < 6; ++i) {
    const Eigen::Quaterniond turned = Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d::UnitZ()) * down;
    PlacedPose pose;
    pose.utime = 1700000000123456 + 100000 * i;
    pose.submap = i / 3;
    pose.frame = i < 3 ? i : i + 5;
    pose.world_from_camera = Rigid3(turned, Eigen::Vector3d(2.0 * i, 0.5, 10));
    map.frames.push_back(pose);
    if (i % 2 == 0) map.keyframes.push_back(pose);
    PlacedPoint point;
    point.position = {2.0 * i + 0.1234567, -1.0 * i, 0.01 * i};
    point.color = {static_cast<uint8_t>(40 * i), 100, 255};
    point.submap = i / 3;
    point.num_images = i == 5 ? 300 : i + 1;
    map.points.push_back(point);
  }
  const auto relate = [&](PlacedRelation::Kind kind, int a, int b) {
    PlacedRelation relation;
    relation.kind = kind;
    relation.a = a;
    relation.b = b;
    relation.a_from_b = map.keyframes[a].world_from_camera.Inverse() * map.keyframes[b].world_from_camera;
    relation.sigma_rotation = 0.01;
    relation.sigma_translation = 0.1;
    map.relations.push_back(relation);
  };
  relate(PlacedRelation::Kind::kTracked, 0, 1);
  relate(PlacedRelation::Kind::kTree, 1, 2);
  relate(PlacedRelation::Kind::kLoop, 0, 2);
  map.losses = {{map.frames[2].utime, "Submap 0: tracking lost after frame 2, too few matches"}};
  return map;
}

// In metres of a zone of UTM.
inline PlacedMap MakeUtmMap() {
  PlacedMap map = MakeTestMap();
  map.frame.name = "utm";
  map.frame.unit = std::string("m");  // GCC 12 warns of the assignment of a literal
  map.frame.is_z_up = true;
  map.frame.epsg = 32630;
  map.frame.origin = {598765, 5912345, 120};
  return map;
}

}  // namespace mapmend
