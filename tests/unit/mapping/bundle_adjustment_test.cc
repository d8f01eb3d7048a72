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

// At the start of a step (where rotations are exact) and well away from it.
TEST(ReprojectionCost, AnalyticJacobiansEqualNumericOnes) {
  std::mt19937_64 rng(1);
  for (int trial = 0; trial < 40; ++trial) {
    const Rigid3 pose(Eigen::Quaterniond(Uniform(&rng, -1, 1), Uniform(&rng, -1, 1), Uniform(&rng, -1, 1), Uniform(&rng, -1, 1)),
                      {Uniform(&rng, -1, 1), Uniform(&rng, -1, 1), Uniform(&rng, -1, 1)});
    SteppedPoses poses({pose});
    Eigen::Map<Vector6d> step(poses.Step(0));
    if (trial % 2 == 1) {
      for (int i = 0; i < 6; ++i) step[i] = Uniform(&rng, -0.4, 0.4);
    }
    const Eigen::Vector3d x_cam(Uniform(&rng, -1, 1), Uniform(&rng, -1, 1), Uniform(&rng, 2, 4));
    Eigen::Vector3d point = poses.Result(0).Inverse() * x_cam;
    const ReprojectionCost cost(kCamera, poses.At(0), {390, 310}, 1.44);
    const double* parameters[] = {step.data(), point.data()};
    const auto residual = [&] {
      poses.PrepareForEvaluation(true, true);
      Eigen::Vector2d r;
      cost.Evaluate(parameters, r.data(), nullptr);
      return r;
    };
    const Eigen::Vector2d expected = (kCamera.Project(x_cam) - Eigen::Vector2d(390, 310)) / 1.44;
    EXPECT_LT((residual() - expected).norm(), 1e-9);
    Eigen::Vector2d unused;
    Eigen::Matrix<double, 2, 6, Eigen::RowMajor> pose_jacobian;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> point_jacobian;
    double* jacobians[] = {pose_jacobian.data(), point_jacobian.data()};
    cost.Evaluate(parameters, unused.data(), jacobians);
    const double h = 1e-6;
    const auto check = [&](double* value, const Eigen::Vector2d& analytic) {
      const double at = *value;
      *value = at + h;
      const Eigen::Vector2d plus = residual();
      *value = at - h;
      const Eigen::Vector2d minus = residual();
      *value = at;
      EXPECT_LT(((plus - minus) / (2 * h) - analytic).norm(), 1e-4 * (1 + analytic.norm()));
    };
    for (int i = 0; i < 6; ++i) check(&step[i], pose_jacobian.col(i));
    for (int i = 0; i < 3; ++i) check(&point[i], point_jacobian.col(i));
  }
}

TEST(SteppedPoses, MovesByRotationOnTheLeft) {
  const Rigid3 pose(Eigen::Quaterniond(0.9, 0.1, -0.3, 0.2), {1, 2, 3});
  Vector6d step;
  step << 0.1, -0.2, 0.3, 0, 0, M_PI / 2;
  const Rigid3 moved = Moved(pose, step);
  EXPECT_LT((moved.translation - Eigen::Vector3d(1.1, 1.8, 3.3)).norm(), 1e-12);
  Eigen::Matrix3d quarter_turn;
  quarter_turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  EXPECT_LT((moved.rotation.toRotationMatrix() - quarter_turn * pose.rotation.toRotationMatrix()).norm(), 1e-12);
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
