#include "tools/simulate/trajectory.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libs/base/degree.h"

namespace mapmend::simulate {
namespace trajectory_test {

Scenario Calm() {
  Scenario scenario;
  scenario.shake = {0, 0, 0.4, 0, 0, 0};
  scenario.trajectory.start = {10, 20, 70};
  scenario.trajectory.strip_length = 100;
  scenario.trajectory.spacing = 20;
  scenario.trajectory.strips = 3;
  scenario.trajectory.speed = 8;
  return scenario;
}

TEST(LookAlong, StraightDownHasTheHeadingUpInTheImage) {
  const Eigen::Quaterniond q = LookAlong(90 * kDegree, 90 * kDegree);
  EXPECT_TRUE((q * Eigen::Vector3d(0, 0, 1)).isApprox(Eigen::Vector3d(0, 0, -1), 1e-12));
  EXPECT_TRUE((q * Eigen::Vector3d(0, -1, 0)).isApprox(Eigen::Vector3d(0, 1, 0), 1e-12)) << "up in the image is north";
  EXPECT_TRUE((q * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(1, 0, 0), 1e-12)) << "right in the image is east";
}

TEST(CameraMotion, SurveyFliesItsStripsAtItsSpeed) {
  const CameraMotion motion(Calm());
  EXPECT_NEAR(motion.Duration(), (3 * 100 + 2 * 20) / 8.0, 1e-3);
  EXPECT_TRUE(motion.WorldFromCamera(0.0).translation.isApprox(Eigen::Vector3d(10, 20, 70), 0.3));
  const Eigen::Vector3d a = motion.WorldFromCamera(5).translation, b = motion.WorldFromCamera(6).translation;
  EXPECT_TRUE((b - a).isApprox(Eigen::Vector3d(8, 0, 0), 1e-9));
  const double second = (100 + 20 + 50) / 8.0;
  EXPECT_TRUE(motion.WorldFromCamera(second).translation.isApprox(Eigen::Vector3d(60, 40, 70), 1e-9));
  EXPECT_TRUE(motion.WorldFromCamera(1000).translation.isApprox(Eigen::Vector3d(110, 60, 70), 1e-9))
      << "rests at the end";
}

TEST(CameraMotion, VelocityIsContinuousAtCorners) {
  Scenario scenario = Calm();
  scenario.trajectory.turn = true;
  const CameraMotion motion(scenario);
  const double h = 1e-3;
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  for (double t = 1; t < 40; t += h) {
    const Eigen::Vector3d velocity =
        (motion.WorldFromCamera(t + h).translation - motion.WorldFromCamera(t).translation) / h;
    if (t > 1) {
      EXPECT_LT((velocity - last).norm(), 0.1);
    }
    last = velocity;
  }
}

TEST(CameraMotion, WindHasTheRootMeanSquareAskedFor) {
  Scenario scenario = Calm();
  scenario.trajectory.kind = TrajectoryOptions::Kind::kPath;
  scenario.trajectory.points = {{{0, 0, 50}, 0.0, 90.0, 0}};
  scenario.shake.position = 0.5;
  scenario.shake.attitude_deg = 2;
  const CameraMotion motion(scenario);
  const Eigen::Quaterniond still = LookAlong(0, 90 * kDegree);
  double position = 0, angle = 0;
  int count = 0;
  for (double t = 0; t < 600; t += 0.25, ++count) {
    const Rigid3 pose = motion.WorldFromCamera(t);
    position += (pose.translation - Eigen::Vector3d(0, 0, 50)).squaredNorm() / 3;
    angle += std::pow(RotationAngle(still.conjugate() * pose.rotation), 2) / 3;
  }
  EXPECT_NEAR(std::sqrt(position / count), 0.5, 0.08);
  EXPECT_NEAR(std::sqrt(angle / count) / kDegree, 2, 0.3);
}

TEST(CameraMotion, EventsMoveTheCameraAndEnd) {
  Scenario scenario = Calm();
  scenario.events = {
      {Event::Kind::kGust, 4, 2, 50}, {Event::Kind::kDrop, 10, 2, 30}, {Event::Kind::kWhipPan, 20, 3, 120}};
  const CameraMotion motion(scenario), calm(Calm());
  const auto turned = [&](double t) {
    return RotationAngle(calm.WorldFromCamera(t).rotation.conjugate() * motion.WorldFromCamera(t).rotation) / kDegree;
  };
  EXPECT_NEAR(turned(5), 50, 1);
  EXPECT_NEAR(turned(3.99), 0, 1e-9);
  EXPECT_NEAR(turned(6.01), 0, 1e-9);
  EXPECT_NEAR(turned(21.5), 120, 1e-6);
  EXPECT_NEAR(motion.WorldFromCamera(11).translation.z(), 40, 1e-9);
}

}  // namespace trajectory_test
}  // namespace mapmend::simulate
