#include "libs/optim/pose_optimization.h"

#include <gtest/gtest.h>

#include "libs/base/random.h"

namespace mapmend {
namespace pose_optimization_test {

TEST(OptimizePose, ConvergesToTheTruthAndMarksOutliers) {
  const Pinhole camera{480, 480, 400, 300, 800, 600};
  const Rigid3 truth(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized())),
                     {0.1, -0.2, 0.3});
  Random random(1);
  std::vector<PoseObservation> observations;
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d x_cam(random.Uniform() - 0.5, random.Uniform() - 0.5, 1 + random.Uniform());
    observations.push_back({truth.Inverse() * x_cam, camera.Project(x_cam), 1.0});
    if (i % 4 == 0) observations.back().pixel += Eigen::Vector2d(30 + i, -20);
  }
  Rigid3 start = truth;
  start.translation += Eigen::Vector3d(0.03, -0.02, 0.02);
  start.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitX())) * start.rotation;
  const auto result = OptimizePose(camera, start, observations, {});
  ASSERT_TRUE(result.success);
  EXPECT_EQ(result.num_inliers, 150);
  for (int i = 0; i < 200; ++i) EXPECT_EQ(result.inlier[i], i % 4 != 0);
  EXPECT_LT((result.cam_from_world.Center() - truth.Center()).norm(), 1e-6);
  EXPECT_LT(RotationAngle(result.cam_from_world.rotation * truth.rotation.conjugate()), 1e-6);
}

TEST(OptimizePose, TooFewObservationsFail) {
  EXPECT_FALSE(OptimizePose({480, 480, 400, 300, 800, 600}, {}, {{{0, 0, 1}, {400, 300}, 1}}, {}).success);
}

}  // namespace pose_optimization_test
}  // namespace mapmend
