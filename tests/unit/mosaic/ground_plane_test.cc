#include "libs/mosaic/ground_plane.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "libs/base/random.h"
#include "libs/geometry/similarity3.h"

namespace mapmend {
namespace ground_plane_test {

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

TEST(FindGroundPlane, OfASurveyWithManyTreesIsTheGround) {
  Random random(3);
  Scene scene;
  for (int i = 0; i < 400; ++i) {
    const bool is_tree = i % 5 < 3;
    const Eigen::Vector3d p(100 * random.Uniform(), 80 * random.Uniform(), is_tree ? 20 * random.Uniform() : 0);
    scene.points.push_back(kMapFromWorld * p);
  }
  for (int i = 0; i < 20; ++i) AddCamera({5.0 * i, 40, 60}, Axes({1, 0, 0}, {0, -1, 0}), &scene);
  const auto ground = FindGroundPlane(scene.points, scene.cameras, 0.3 * 0.5);
  ASSERT_TRUE(ground.has_value());
  EXPECT_GT(ground->normal.dot(Up()), std::cos(0.5 * M_PI / 180));
  EXPECT_NEAR(ground->share, 0.4, 0.05);
  EXPECT_NEAR(ground->normal.dot(kMapFromWorld * Eigen::Vector3d(50, 40, 0)) - ground->offset, 0, 0.05);
}

// Held upright, driven along a street: the wall at its end has more points than the ground.
TEST(FindGroundPlane, IsNoWallAhead) {
  Random random(3);
  Scene scene;
  for (int i = 0; i < 300; ++i) {
    Eigen::Vector3d p(8 * random.Uniform() - 4, 40 * random.Uniform(), 0);
    if (i % 3 > 0) p = {20 * random.Uniform() - 10, 60, 20 * random.Uniform() - 2};
    scene.points.push_back(kMapFromWorld * p);
  }
  for (int i = 0; i < 20; ++i) AddCamera({0, 1.0 * i, 1.5}, Axes({1, 0, 0}, {0, 0, -1}), &scene);
  const auto ground = FindGroundPlane(scene.points, scene.cameras, 0.3 * 0.1);
  ASSERT_TRUE(ground.has_value());
  EXPECT_GT(ground->normal.dot(Up()), std::cos(0.5 * M_PI / 180));
}

TEST(FindGroundPlane, ThereIsNoneInACloud) {
  Random random(3);
  Scene scene;
  for (int i = 0; i < 300; ++i)
    scene.points.push_back(kMapFromWorld *
                           Eigen::Vector3d(50 * random.Uniform(), 50 * random.Uniform(), 50 * random.Uniform()));
  for (int i = 0; i < 20; ++i) AddCamera({2.0 * i, 25, 70}, Axes({1, 0, 0}, {0, -1, 0}), &scene);
  EXPECT_FALSE(FindGroundPlane(scene.points, scene.cameras, 0.3 * 0.5).has_value());
  EXPECT_FALSE(FindGroundPlane({}, scene.cameras, 1).has_value());
  EXPECT_FALSE(FindGroundPlane(scene.points, {}, 1).has_value());
}

}  // namespace ground_plane_test
}  // namespace mapmend
