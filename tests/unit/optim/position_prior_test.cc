#include "libs/optim/position_prior.h"

#include <gtest/gtest.h>

#include "libs/optim/bundle_adjuster.h"
#include "libs/optim/bundle_adjustment.h"
#include "libs/optim/sim3_pose_graph.h"

namespace mapmend {
namespace position_prior_test {

Rigid3 SomePose() { return {Eigen::Quaterniond(0.7, 0.1, -0.4, 0.3).normalized(), {1, -2, 3}}; }

TEST(PositionPrior, JacobianIsTheDerivative) {
  SteppedPoses poses({SomePose()});
  PositionPrior prior;
  prior.pose = 0;
  prior.position = {0.3, 0.2, -0.1};
  prior.whitening << 2, 0.3, 0, 0, 1, 0.2, 0.1, 0, 0.5;
  const PositionCost cost(poses.At(0), prior);
  Eigen::Map<Vector6d> step(poses.Step(0));
  step << 0.1, -0.2, 0.05, 0.3, -0.1, 0.2;
  const auto residual = [&] {
    poses.PrepareForEvaluation(true, true);
    const double* parameters[] = {poses.Step(0)};
    Eigen::Vector3d r;
    cost.Evaluate(parameters, r.data(), nullptr);
    return r;
  };
  residual();
  const double* parameters[] = {poses.Step(0)};
  Eigen::Vector3d r;
  Eigen::Matrix<double, 3, 6, Eigen::RowMajor> jacobian;
  double* jacobians[] = {jacobian.data()};
  cost.Evaluate(parameters, r.data(), jacobians);
  for (int i = 0; i < 6; ++i) {
    constexpr double kStep = 1e-6;
    step(i) += kStep;
    const Eigen::Vector3d above = residual();
    step(i) -= 2 * kStep;
    const Eigen::Vector3d below = residual();
    step(i) += kStep;
    EXPECT_LT(((above - below) / (2 * kStep) - jacobian.col(i)).norm(), 1e-6) << i;
  }
}

TEST(PositionPrior, AChainOfRelationsIsStraightened) {
  // Ten steps of one metre, each turned a little by drift: without positions the end is half a metre aside.
  std::vector<PoseGraphEdge> edges;
  std::vector<Similarity3> vertices(11);
  std::vector<PositionPrior> priors;
  for (int i = 0; i < 11; ++i) {
    vertices[i].translation = {static_cast<double>(i), 0.01 * i * i, 0};
    PositionPrior prior;
    prior.pose = i;
    prior.position = {static_cast<double>(i), 0, 0};
    prior.whitening = Eigen::Matrix3d::Identity() / 0.1;
    priors.push_back(prior);
    if (i == 0) continue;
    PoseGraphEdge edge;
    edge.a = i - 1;
    edge.b = i;
    edge.b_from_a = Similarity3(1, Eigen::Quaterniond(Eigen::AngleAxisd(-0.01, Eigen::Vector3d::UnitZ())), {-1, 0, 0});
    edges.push_back(edge);
  }
  std::vector<Similarity3> without = vertices;
  ASSERT_TRUE(OptimizePoseGraph(edges, 0, {}, &without).success);
  EXPECT_GT(std::abs(without[10].translation.y()), 0.3);
  // One wrong position loses its influence.
  priors[5].position.y() = 40;
  ASSERT_TRUE(OptimizePoseGraph(edges, -1, {}, &vertices, &priors).success);
  for (int i = 0; i < 11; ++i) EXPECT_NEAR(vertices[i].translation.y(), 0, 0.1) << i;
}

TEST(PositionPrior, BundleAdjustmentTakesScaleAndPlaceFromThem) {
  const Pinhole camera{480, 470, 400, 300, 800, 600};
  BundleProblem problem;
  problem.cameras = {camera};
  const double scale = 0.7;  // of the start; the images do not tell
  std::vector<Eigen::Vector3d> centers;
  for (int i = 0; i < 5; ++i) {
    centers.emplace_back(0.5 * i, 0.1 * (i % 2), -4);
    problem.poses.push_back({Rigid3(Eigen::Matrix3d::Identity(), centers.back()).Inverse(), false, 0});
  }
  for (int x = 0; x < 6; ++x) {
    for (int y = 0; y < 6; ++y) problem.points.emplace_back(0.6 * x - 0.5, 0.4 * y - 1, 0.1 * ((x * y) % 3));
  }
  for (int i = 0; i < 5; ++i) {
    for (size_t p = 0; p < problem.points.size(); ++p)
      problem.observations.push_back(
          {i, static_cast<int>(p), camera.Project(problem.poses[i].cam_from_world * problem.points[p]), 1});
  }
  std::vector<PositionPrior> priors;
  for (int i = 0; i < 5; ++i) priors.push_back({i, centers[i], Eigen::Matrix3d::Identity() / 0.05});
  for (BundlePose& pose : problem.poses) pose.cam_from_world.translation *= scale;
  for (Eigen::Vector3d& point : problem.points) point *= scale;
  BundleOptions options;
  options.max_iterations = 50;
  options.function_tolerance = 1e-12;
  ASSERT_TRUE(BundleAdjuster().Adjust(options, &problem, &priors).success);
  for (int i = 0; i < 5; ++i) EXPECT_LT((problem.poses[i].cam_from_world.Center() - centers[i]).norm(), 1e-3) << i;
}

}  // namespace position_prior_test
}  // namespace mapmend
