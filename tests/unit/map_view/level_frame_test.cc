#include "libs/map_view/level_frame.h"

#include <gtest/gtest.h>

#include "libs/base/random.h"
#include "tests/test_flight.h"

namespace mapmend {
namespace {

// What is level in the world, turned by any rotation.
const Similarity3 kMapFromWorld(0.3, Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2), {1, 2, 3});

struct Scene {
  std::vector<Eigen::Vector3d> points;
  Trajectory cameras;
};

void AddCamera(const Eigen::Vector3d& center, const Eigen::Matrix3d& rotation, Scene* scene) {
  const Rigid3 cam_from_world = Rigid3(rotation, center).Inverse();
  scene->cameras.push_back({0, TransformWorld(cam_from_world, kMapFromWorld).Inverse()});
}

Eigen::Vector3d Up() { return kMapFromWorld.rotation * Eigen::Vector3d::UnitZ(); }

// The axes of a camera in the world.
Eigen::Matrix3d Axes(const Eigen::Vector3d& x, const Eigen::Vector3d& y) {
  Eigen::Matrix3d rotation;
  rotation << x, y, x.cross(y);
  return rotation;
}

TEST(FindGround, OfASurveyWithManyTreesIsTheGround) {
  Random random(3);
  Scene scene;
  for (int i = 0; i < 400; ++i) {
    const bool is_tree = i % 5 < 3;
    const Eigen::Vector3d p(100 * random.Uniform(), 80 * random.Uniform(), is_tree ? 20 * random.Uniform() : 0);
    scene.points.push_back(kMapFromWorld * p);
  }
  for (int i = 0; i < 20; ++i) AddCamera({5.0 * i, 40, 60}, Axes({1, 0, 0}, {0, -1, 0}), &scene);
  const auto ground = FindGround(scene.points, scene.cameras, 0.3 * 0.5);
  ASSERT_TRUE(ground.has_value());
  EXPECT_GT(ground->normal.dot(Up()), std::cos(0.5 * M_PI / 180));
  EXPECT_NEAR(ground->share, 0.4, 0.05);
  EXPECT_NEAR(ground->normal.dot(kMapFromWorld * Eigen::Vector3d(50, 40, 0)) - ground->offset, 0, 0.05);
}

// Held upright, driven along a street: the wall at its end has more points than the ground.
TEST(FindGround, IsNoWallAhead) {
  Random random(3);
  Scene scene;
  for (int i = 0; i < 300; ++i) {
    Eigen::Vector3d p(8 * random.Uniform() - 4, 40 * random.Uniform(), 0);
    if (i % 3 > 0) p = {20 * random.Uniform() - 10, 60, 20 * random.Uniform() - 2};
    scene.points.push_back(kMapFromWorld * p);
  }
  for (int i = 0; i < 20; ++i) AddCamera({0, 1.0 * i, 1.5}, Axes({1, 0, 0}, {0, 0, -1}), &scene);
  const auto ground = FindGround(scene.points, scene.cameras, 0.3 * 0.1);
  ASSERT_TRUE(ground.has_value());
  EXPECT_GT(ground->normal.dot(Up()), std::cos(0.5 * M_PI / 180));
}

TEST(FindGround, ThereIsNoneInACloud) {
  Random random(3);
  Scene scene;
  for (int i = 0; i < 300; ++i)
    scene.points.push_back(kMapFromWorld *
                           Eigen::Vector3d(50 * random.Uniform(), 50 * random.Uniform(), 50 * random.Uniform()));
  for (int i = 0; i < 20; ++i) AddCamera({2.0 * i, 25, 70}, Axes({1, 0, 0}, {0, -1, 0}), &scene);
  EXPECT_FALSE(FindGround(scene.points, scene.cameras, 0.3 * 0.5).has_value());
  EXPECT_FALSE(FindGround({}, scene.cameras, 1).has_value());
  EXPECT_FALSE(FindGround(scene.points, {}, 1).has_value());
}

TEST(PlaceLevel, PutsTheGroundAtZeroUnderTheFirstCamera) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  Snapshot snapshot = MakeSnapshot(model);
  PlaceLevel(0, &snapshot);
  EXPECT_EQ(snapshot.components[0].frame.name, "level");
  EXPECT_EQ(snapshot.components[0].frame.unit, "map units");
  for (const ColoredPoint& point : ComponentPoints(snapshot, 0)) EXPECT_NEAR(point.position.z(), 0, 1e-4);
  for (const MergedFrame& frame : snapshot.components[0].frames) {  // a unit is 10 m
    EXPECT_NEAR(frame.cam_from_root.Center().z(), flight.WorldFromCamera(frame.frame).translation.z() / 10, 1e-4);
  }
  EXPECT_LT(snapshot.components[0].keyframes[0].cam_from_root.Center().head<2>().norm(), 1e-6);
  // As in the picture from above: the strips from left to right, not mirrored.
  const auto center = [&](int i) { return snapshot.components[0].frames[i].cam_from_root.Center(); };
  EXPECT_GT(center(10).x() - center(0).x(), 4.9);
  EXPECT_NEAR(center(10).y(), center(0).y(), 1e-3);
}

}  // namespace
}  // namespace mapmend
