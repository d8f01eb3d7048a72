#include "libs/optim/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>
#include <set>
#include <tuple>

#include "libs/optim/bundle_points.h"
#include "libs/optim/reprojection_cost.h"

namespace mapmend {
namespace bundle_adjustment_test {

const Pinhole kCamera{480, 470, 400, 300, 800, 600};

double Uniform(std::mt19937_64* rng, double low, double high) {
  return low + (high - low) * static_cast<double>((*rng)() >> 11) * 0x1.0p-53;
}

// At the start of a step (where rotations are exact) and well away from it.
TEST(ReprojectionCost, AnalyticJacobiansEqualNumericOnes) {
  std::mt19937_64 rng(1);
  for (int trial = 0; trial < 40; ++trial) {
    const Rigid3 pose(
        Eigen::Quaterniond(Uniform(&rng, -1, 1), Uniform(&rng, -1, 1), Uniform(&rng, -1, 1), Uniform(&rng, -1, 1)),
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

// A strip of exact views over a plane with relief.
BundleProblem ExactStrip(std::mt19937_64* rng) {
  BundleProblem strip;
  strip.cameras = {kCamera};
  for (int i = 0; i < 8; ++i) {
    const Rigid3 world_from_cam(Eigen::Quaterniond(Eigen::AngleAxisd(0.03 * i, Eigen::Vector3d::UnitX())),
                                {0.15 * i, 0.02 * i, -1.0});
    strip.poses.push_back({world_from_cam.Inverse(), i < 2, 0});
  }
  for (int i = 0; i < 300; ++i) {
    strip.points.emplace_back(Uniform(rng, -0.5, 1.6), Uniform(rng, -0.5, 0.5), Uniform(rng, -0.1, 0.1));
  }
  for (size_t p = 0; p < strip.poses.size(); ++p) {
    for (size_t x = 0; x < strip.points.size(); ++x) {
      const Eigen::Vector2d pixel = kCamera.Project(strip.poses[p].cam_from_world * strip.points[x]);
      if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() > 800 || pixel.y() > 600) continue;
      strip.observations.push_back({static_cast<int>(p), static_cast<int>(x), pixel, 1.0});
    }
  }
  return strip;
}

void Disturb(std::mt19937_64* rng, BundleProblem* problem) {
  for (BundlePose& pose : problem->poses) {
    if (!pose.fixed) pose.cam_from_world.translation += Eigen::Vector3d::Constant(Uniform(rng, -0.02, 0.02));
  }
  for (Eigen::Vector3d& point : problem->points) point.z() += Uniform(rng, -0.05, 0.05);
}

// Disturbed, it must come back to the truth, and outliers must not drag it off.
TEST(BundleAdjustment, RecoversPosesAndPointsAndResistsOutliers) {
  std::mt19937_64 rng(2);
  const BundleProblem truth = ExactStrip(&rng);
  BundleProblem problem = truth;
  Disturb(&rng, &problem);
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

TEST(BundleAdjustment, ByAPartOfThePointsMovesTheOthersToo) {
  std::mt19937_64 rng(3);
  const BundleProblem truth = ExactStrip(&rng);
  BundleProblem problem = truth;
  Disturb(&rng, &problem);
  BundleOptions options;
  options.max_iterations = 50;
  options.function_tolerance = 1e-12;
  options.points_per_pose = 48;
  const std::vector<uint8_t> chosen =
      ChooseBundlePoints(problem, ObservationsByPoint(problem), options.points_per_pose);
  EXPECT_LT(std::accumulate(chosen.begin(), chosen.end(), 0), 200);
  ASSERT_TRUE(AdjustBundle(options, &problem).success);
  for (size_t i = 0; i < truth.poses.size(); ++i) {
    EXPECT_LT((problem.poses[i].cam_from_world.Center() - truth.poses[i].cam_from_world.Center()).norm(), 1e-4);
  }
  const ObservationsByPoint observations(truth);
  int followed = 0;
  for (size_t i = 0; i < truth.points.size(); ++i) {
    if (observations.Of(i).size() < 3) continue;
    EXPECT_LT((problem.points[i] - truth.points[i]).norm(), 2e-3) << i;
    followed += !chosen[i];
  }
  EXPECT_GT(followed, 50);
}

TEST(BundlePoints, EveryPartOfAnImageHasItsShare) {
  std::mt19937_64 rng(4);
  const BundleProblem problem = ExactStrip(&rng);
  const std::vector<uint8_t> chosen =
      ChooseBundlePoints(problem, ObservationsByPoint(problem), 48);  // one for each cell of 100 x 100 pixels
  std::set<std::tuple<int, int, int>> all, held;
  for (const BundleObservation& o : problem.observations) {
    if (problem.poses[o.pose].fixed) continue;
    const std::tuple cell(o.pose, static_cast<int>(o.pixel.x() / 100), static_cast<int>(o.pixel.y() / 100));
    all.insert(cell);
    if (chosen[o.point]) held.insert(cell);
  }
  EXPECT_EQ(held, all);
}

TEST(BundlePoints, LongTracksComeFirst) {
  BundleProblem problem;
  problem.cameras = {kCamera};
  problem.poses.resize(3);
  problem.points.resize(2);
  // Both points in one cell of each image; the second is seen once more.
  problem.observations = {
      {0, 0, {10, 10}, 1}, {1, 0, {10, 10}, 1}, {0, 1, {20, 20}, 1}, {1, 1, {20, 20}, 1}, {2, 1, {20, 20}, 1}};
  EXPECT_EQ(ChooseBundlePoints(problem, ObservationsByPoint(problem), 1), (std::vector<uint8_t>{0, 1}));
}

TEST(BundlePoints, APointMovesToWhereItIsSeenAndNotBehindACamera) {
  std::mt19937_64 rng(5);
  const BundleProblem truth = ExactStrip(&rng);
  const ObservationsByPoint observations(truth);
  std::vector<Eigen::Matrix3d> rotations;
  for (const BundlePose& pose : truth.poses) rotations.push_back(pose.cam_from_world.rotation.toRotationMatrix());
  const auto seen = observations.Of(0);
  ASSERT_GE(seen.size(), 3u);
  Eigen::Vector3d point = truth.points[0] + Eigen::Vector3d(0.01, -0.01, 0.03);
  RefineBundlePoint(truth, rotations, seen, 2.4, &point);
  EXPECT_LT((point - truth.points[0]).norm(), 1e-3);
  const Eigen::Vector3d behind(0, 0, -5);
  point = behind;
  RefineBundlePoint(truth, rotations, seen, 2.4, &point);
  EXPECT_EQ(point, behind);
}

TEST(BundleAdjustment, WithoutObservationsNothingChanges) {
  BundleProblem problem;
  problem.points.emplace_back(1, 2, 3);
  EXPECT_FALSE(AdjustBundle({}, &problem).success);
  EXPECT_EQ(problem.points[0], Eigen::Vector3d(1, 2, 3));
}

}  // namespace bundle_adjustment_test
}  // namespace mapmend
