#include "libs/geometry/gap_in_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "libs/geometry/similarity3.h"

namespace mapmend {
namespace gap_in_path_test {

// A camera that turns by so much a second, and flies with this velocity in its own frame.
std::vector<PathPose> Turning(double from, double to, double step) {
  std::vector<PathPose> path;
  for (double t = from; t < to + step / 2; t += step) {
    const double angle = 0.3 * t;
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
    path.push_back({t, {turn, Eigen::Vector3d(5 * std::sin(angle), 5 * (1 - std::cos(angle)), 0.4 * t)}});
  }
  return path;
}

// The same path in another world and unit.
std::vector<PathPose> Moved(std::vector<PathPose> path, const Similarity3& other_from_world) {
  for (PathPose& pose : path) {
    const Similarity3 moved = other_from_world * Similarity3(pose.world_from_cam);
    pose.world_from_cam = Rigid3(moved.rotation, moved.translation);
  }
  return path;
}

TEST(GapInPath, AnEvenTurnIsFoundExactlyInAnyUnit) {
  const auto before = Turning(0, 4, 0.1), after = Turning(7, 10, 0.1);
  const Similarity3 other(2.5, Eigen::Quaterniond(Eigen::AngleAxisd(1.2, Eigen::Vector3d(1, 2, 3).normalized())),
                          {4, 5, 6});
  const BridgedGap gap = BridgeGap(before, Moved(after, other));
  ASSERT_TRUE(gap.success);
  EXPECT_NEAR(gap.seconds, 3, 1e-9);
  const Rigid3 truth = before.back().world_from_cam.Inverse() * after.front().world_from_cam;
  EXPECT_LT((gap.before_from_after.translation - truth.translation).norm(), 1e-9);
  EXPECT_LT(RotationAngle(gap.before_from_after.rotation * truth.rotation.conjugate()), 1e-7);
  EXPECT_NEAR(gap.scale, 1 / 2.5, 1e-9);
  EXPECT_LT(gap.sigma_position, 1e-6);
  EXPECT_LT(gap.sigma_angle, 1e-6);
  EXPECT_LT(gap.sigma_scale, 1e-6);
}

// Wind: the velocity changes by chance, a little from frame to frame, and springs back.
std::vector<PathPose> InTheWind(std::mt19937_64* random, double seconds) {
  std::normal_distribution<double> normal;
  std::vector<PathPose> path;
  Eigen::Vector3d place(0, 0, 0), gust(0, 0, 0);
  double turn = 0, heading = 0;
  constexpr double kStep = 0.1;
  for (double t = 0; t < seconds; t += kStep) {
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()));
    path.push_back({t, {rotation, place}});
    gust += Eigen::Vector3d(normal(*random), normal(*random), normal(*random)) * 0.3 - 0.05 * gust;
    turn += 0.02 * normal(*random) - 0.05 * turn;
    heading += kStep * turn;
    place += kStep * (rotation * Eigen::Vector3d(8, 0, 0) + gust);
  }
  return path;
}

TEST(GapInPath, ItsUncertaintyIsThatOfTheFlight) {
  std::mt19937_64 random(5);
  constexpr int kNum = 200;
  int within_two_sigma = 0;
  std::vector<double> ratios;
  for (int i = 0; i < kNum; ++i) {
    const auto path = InTheWind(&random, 30);
    const std::vector<PathPose> before(path.begin(), path.begin() + 120), after(path.begin() + 150, path.end());
    const BridgedGap gap = BridgeGap(before, after);
    ASSERT_TRUE(gap.success);
    const Rigid3 truth = before.back().world_from_cam.Inverse() * after.front().world_from_cam;
    const double error = (gap.before_from_after.translation - truth.translation).norm();
    ratios.push_back(error / gap.sigma_position);
    within_two_sigma += error < 2 * gap.sigma_position ? 1 : 0;
  }
  EXPECT_GT(within_two_sigma, 0.9 * kNum);
  std::nth_element(ratios.begin(), ratios.begin() + kNum / 2, ratios.end());
  EXPECT_GT(ratios[kNum / 2], 0.4) << "not more uncertain than it is";
}

TEST(GapInPath, AcrossALongGapAnOverlookedAccelerationCounts) {
  std::mt19937_64 random(6);
  const auto path = InTheWind(&random, 40);
  const std::vector<PathPose> before(path.begin(), path.begin() + 60);
  const BridgedGap shorter = BridgeGap(before, {path.begin() + 100, path.begin() + 160}),
                   longer = BridgeGap(before, {path.begin() + 300, path.begin() + 360});
  EXPECT_GT(longer.sigma_position, 10 * shorter.sigma_position);
}

TEST(GapInPath, WhatTellsNoMotionTellsNoPlace) {
  const auto before = Turning(0, 4, 0.1), after = Turning(7, 10, 0.1);
  EXPECT_FALSE(BridgeGap({before.begin(), before.begin() + 2}, after).success);
  EXPECT_FALSE(BridgeGap(before, {after.begin(), after.begin() + 2}).success);
  EXPECT_FALSE(BridgeGap(after, before).success) << "no time in between";
  std::vector<PathPose> still = after;
  for (PathPose& pose : still) pose.world_from_cam = Rigid3();
  EXPECT_FALSE(BridgeGap(before, still).success);
}

}  // namespace gap_in_path_test
}  // namespace mapmend
