#include "libs/mapping/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <random>

#include "libs/mapping/reprojection_cost.h"

namespace mapmend {
namespace {

const Pinhole kCamera{480, 470, 400, 300, 800, 600};

double Uniform(std::mt19937_64* rng, double low, double high) {
  return low + (high - low) * static_cast<double>((*rng)() >> 11) * 0x1.0p-53;
}

TEST(ReprojectionCost, AnalyticJacobiansEqualNumericOnes) {
  std::mt19937_64 rng(1);
  PoseManifold manifold;
  for (int trial = 0; trial < 20; ++trial) {
    const Rigid3 pose(Eigen::Quaterniond(Uniform(&rng, -1, 1), Uniform(&rng, -1, 1), Uniform(&rng, -1, 1), Uniform(&rng, -1, 1)),
                      {Uniform(&rng, -1, 1), Uniform(&rng, -1, 1), Uniform(&rng, -1, 1)});
    const Eigen::Vector3d x_cam(Uniform(&rng, -1, 1), Uniform(&rng, -1, 1), Uniform(&rng, 2, 4));
    Eigen::Vector3d point = pose.Inverse() * x_cam;
    auto pose_values = ToArray(pose);
    const ReprojectionCost cost(kCamera, {390, 310}, 1.44);
    const double* parameters[] = {pose_values.data(), point.data()};
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 7, Eigen::RowMajor> pose_jacobian;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> point_jacobian;
    double* jacobians[] = {pose_jacobian.data(), point_jacobian.data()};
    cost.Evaluate(parameters, residual.data(), jacobians);
    const double h = 1e-6;
    for (int i = 0; i < 6; ++i) {
      Eigen::Vector2d plus, minus;
      for (const double sign : {1.0, -1.0}) {
        std::array<double, 6> delta{};
        delta[i] = sign * h;
        std::array<double, 7> moved;
        manifold.Plus(pose_values.data(), delta.data(), moved.data());
        const double* p[] = {moved.data(), point.data()};
        cost.Evaluate(p, (sign > 0 ? plus : minus).data(), nullptr);
      }
      EXPECT_LT(((plus - minus) / (2 * h) - pose_jacobian.col(i)).norm(), 1e-4 * (1 + pose_jacobian.col(i).norm()));
    }
    for (int i = 0; i < 3; ++i) {
      Eigen::Vector2d plus, minus;
      for (const double sign : {1.0, -1.0}) {
        Eigen::Vector3d moved = point;
        moved[i] += sign * h;
        const double* p[] = {pose_values.data(), moved.data()};
        cost.Evaluate(p, (sign > 0 ? plus : minus).data(), nullptr);
      }
      EXPECT_LT(((plus - minus) / (2 * h) - point_jacobian.col(i)).norm(), 1e-4 * (1 + point_jacobian.col(i).norm()));
    }
  }
}

TEST(PoseManifold, MinusUndoesPlus) {
  PoseManifold manifold;
  const auto x = ToArray(Rigid3(Eigen::Quaterniond(0.9, 0.1, -0.3, 0.2), {1, 2, 3}));
  const std::array<double, 6> delta = {0.1, -0.2, 0.3, 0.05, -0.04, 0.2};
  std::array<double, 7> y;
  std::array<double, 6> back;
  manifold.Plus(x.data(), delta.data(), y.data());
  manifold.Minus(y.data(), x.data(), back.data());
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(back[i], delta[i], 1e-12);
}

// A strip of exact views over a plane with relief, disturbed, must come back to the truth, and outliers must not drag it off.
TEST(BundleAdjustment, RecoversPosesAndPointsAndResistsOutliers) {
  std::mt19937_64 rng(2);
  BundleProblem truth;
  truth.cameras = {kCamera};
  for (int i = 0; i < 8; ++i) {
    const Rigid3 world_from_cam(Eigen::Quaterniond(Eigen::AngleAxisd(0.03 * i, Eigen::Vector3d::UnitX())),
                                {0.15 * i, 0.02 * i, -1.0});
    truth.poses.push_back({world_from_cam.Inverse(), i < 2, 0});
  }
  for (int i = 0; i < 300; ++i) {
    truth.points.emplace_back(Uniform(&rng, -0.5, 1.6), Uniform(&rng, -0.5, 0.5), Uniform(&rng, -0.1, 0.1));
  }
  for (size_t p = 0; p < truth.poses.size(); ++p) {
    for (size_t x = 0; x < truth.points.size(); ++x) {
      const Eigen::Vector2d pixel = kCamera.Project(truth.poses[p].cam_from_world * truth.points[x]);
      if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() > 800 || pixel.y() > 600) continue;
      truth.observations.push_back({static_cast<int>(p), static_cast<int>(x), pixel, 1.0});
    }
  }
  BundleProblem problem = truth;
  for (BundlePose& pose : problem.poses) {
    if (!pose.fixed) pose.cam_from_world.translation += Eigen::Vector3d::Constant(Uniform(&rng, -0.02, 0.02));
  }
  for (Eigen::Vector3d& point : problem.points) point.z() += Uniform(&rng, -0.05, 0.05);
  for (size_t i = 0; i < problem.observations.size(); i += 97) problem.observations[i].pixel.x() += 40;
  BundleOptions options;
  options.max_iterations = 50;
  options.function_tolerance = 1e-12;
  const BundleSummary summary = AdjustBundle(options, &problem);
  ASSERT_TRUE(summary.success);
  EXPECT_LT(summary.final_cost, summary.initial_cost);
  for (size_t i = 0; i < truth.poses.size(); ++i) {
    EXPECT_LT((problem.poses[i].cam_from_world.Center() - truth.poses[i].cam_from_world.Center()).norm(), 2e-3);
  }
}

TEST(BundleAdjustment, WithoutObservationsNothingChanges) {
  BundleProblem problem;
  problem.points.emplace_back(1, 2, 3);
  EXPECT_FALSE(AdjustBundle({}, &problem).success);
  EXPECT_EQ(problem.points[0], Eigen::Vector3d(1, 2, 3));
}

}  // namespace
}  // namespace mapmend
