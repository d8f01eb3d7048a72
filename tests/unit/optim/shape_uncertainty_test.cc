#include "libs/optim/shape_uncertainty.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libs/base/random.h"

namespace mapmend {
namespace {

constexpr double kMaxChi2 = 1e9;

double Gauss(Random* random) {
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += random->Uniform();
  return sum;
}

// Four cameras that move sideways by baseline, over points at depths of 1 to 1 + relief.
BundleProblem Strip(double baseline, double relief, double noise, uint64_t seed) {
  Random random(seed);
  BundleProblem problem;
  problem.cameras = {Pinhole{480, 480, 400, 300, 800, 600}};
  for (int i = 0; i < 4; ++i) {
    problem.poses.push_back({Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(0.02 * i, Eigen::Vector3d::UnitZ())),
                                    {-baseline * i / 3, 0.1 * baseline * i, 0}),
                             i == 0, 0});
  }
  for (int i = 0; i < 120; ++i) {
    const double z = 1 + relief * random.Uniform();
    problem.points.emplace_back(z * (1.2 * random.Uniform() - 0.6), z * (0.9 * random.Uniform() - 0.45), z);
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector2d pixel = problem.cameras[0].Project(problem.poses[k].cam_from_world * problem.points.back());
      problem.observations.push_back({k, i, pixel + noise * Eigen::Vector2d(Gauss(&random), Gauss(&random)), 1.0});
    }
  }
  return problem;
}

// Error of the path after bundle adjustment, of its extent; scale is free.
double Error(const BundleProblem& truth, BundleProblem problem) {
  BundleOptions options;
  options.max_iterations = 50;
  options.function_tolerance = 1e-9;
  EXPECT_TRUE(AdjustBundle(options, &problem).success);
  double found_true = 0, found_found = 0, extent = 0, error = 0;
  for (int k = 1; k < 4; ++k) {
    const Eigen::Vector3d t = truth.poses[k].cam_from_world.Center(), f = problem.poses[k].cam_from_world.Center();
    found_true += f.dot(t);
    found_found += f.squaredNorm();
    extent += t.squaredNorm();
  }
  for (int k = 1; k < 4; ++k) {
    const Eigen::Vector3d t = truth.poses[k].cam_from_world.Center(), f = problem.poses[k].cam_from_world.Center();
    error += (found_true / found_found * f - t).squaredNorm();
  }
  return std::sqrt(error / extent);
}

TEST(ShapeUncertainty, ForetellsTheErrorsOfBundleAdjustment) {
  for (const auto& [baseline, relief] : {std::pair(0.1, 0.5), std::pair(0.2, 0.05)}) {
    double squares = 0;
    constexpr int kTrials = 25;
    const BundleProblem truth = Strip(baseline, relief, 0, 1);
    for (int trial = 0; trial < kTrials; ++trial) {
      BundleProblem noisy = truth;
      Random random(100 + trial);
      for (BundleObservation& o : noisy.observations) o.pixel += Eigen::Vector2d(Gauss(&random), Gauss(&random));
      squares += std::pow(Error(truth, noisy), 2) / kTrials;
    }
    const double expected = RelativeShapeSigma(truth, kMaxChi2);
    EXPECT_GT(std::sqrt(squares), 0.6 * expected) << baseline;
    EXPECT_LT(std::sqrt(squares), 1.4 * expected) << baseline;
  }
}

TEST(ShapeUncertainty, FallsAsTheBaselineGrows) {
  const double narrow = RelativeShapeSigma(Strip(0.03, 0.3, 0, 2), kMaxChi2);
  const double wide = RelativeShapeSigma(Strip(0.12, 0.3, 0, 2), kMaxChi2);
  EXPECT_GT(narrow, 3 * wide);
  EXPECT_LT(narrow, 5 * wide);
}

TEST(ShapeUncertainty, IsTheSameInAnyScaleAndFrame) {
  BundleProblem problem = Strip(0.1, 0.3, 0, 3);
  const double sigma = RelativeShapeSigma(problem, kMaxChi2);
  const Rigid3 moved(Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized())), {4, 5, 6});
  for (Eigen::Vector3d& x : problem.points) x = 7 * (moved * x);
  for (BundlePose& pose : problem.poses) {
    pose.cam_from_world = pose.cam_from_world * moved.Inverse();
    pose.cam_from_world.translation *= 7;
  }
  EXPECT_NEAR(RelativeShapeSigma(problem, kMaxChi2), sigma, 0.02 * sigma);
}

TEST(ShapeUncertainty, ATurnOnTheSpotHasNoShape) {
  BundleProblem problem = Strip(0.1, 0.3, 0, 4);
  for (BundlePose& pose : problem.poses) pose.cam_from_world.translation.setZero();
  EXPECT_TRUE(std::isinf(RelativeShapeSigma(problem, kMaxChi2)));
  problem.poses.resize(1);
  problem.observations.clear();
  EXPECT_TRUE(std::isinf(RelativeShapeSigma(problem, kMaxChi2)));
}

}  // namespace
}  // namespace mapmend
