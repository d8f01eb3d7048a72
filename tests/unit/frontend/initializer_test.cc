#include "procs/frontend/initializer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "libs/geometry/alignment.h"
#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace initializer_test {

// Rotation exact to tenths of a degree, translation in the right direction, and points where they are, up to scale.
void ExpectMotion(const Initialization& initialization, const Rigid3& first, const Rigid3& second) {
  ASSERT_TRUE(initialization.success) << ToString(initialization.reason);
  const Rigid3 truth = second * first.Inverse();
  EXPECT_LT(RotationAngle(initialization.second_from_first.rotation * truth.rotation.conjugate()), 0.005);
  EXPECT_GT(initialization.second_from_first.translation.normalized().dot(truth.translation.normalized()), 0.999);
}

TEST(Initializer, PlanarNadirSceneAtSurveySpacing) {
  SyntheticScene scene(1500, -2, 3, 0.0, 1);
  Initializer initializer({}, scene.Camera(), {});
  const Rigid3 a = NadirPose(0, 0), b = NadirPose(0.15, 0.01, 0.05);
  EXPECT_FALSE(initializer.AddFrame(scene.View(a, 0)).success);
  ExpectMotion(initializer.AddFrame(scene.View(b, 1)), a, b);
}

TEST(Initializer, RoughScene) {
  SyntheticScene scene(1500, -2, 3, 0.25, 2);
  Initializer initializer({}, scene.Camera(), {});
  const Rigid3 a = NadirPose(0, 0), b = NadirPose(0.1, 0.1, 0.3);
  initializer.AddFrame(scene.View(a, 0));
  ExpectMotion(initializer.AddFrame(scene.View(b, 1)), a, b);
}

TEST(Initializer, PureRotationIsRefused) {
  SyntheticScene scene(1500, -2, 3, 0.2, 3);
  Initializer initializer({}, scene.Camera(), {});
  initializer.AddFrame(scene.View(NadirPose(0, 0), 0));
  for (int i = 1; i < 4; ++i) {
    Rigid3 turned = NadirPose(0, 0, 0.1 * i);
    turned =
        Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(0.05 * i, Eigen::Vector3d::UnitX())), Eigen::Vector3d::Zero()) *
        turned;
    const Initialization result = initializer.AddFrame(scene.View(turned, i));
    EXPECT_FALSE(result.success);
    EXPECT_NE(result.reason, LossReason::kNone);
  }
}

// Small steps with turns: the motion found is the true one, or none.
TEST(Initializer, SmallStepsWithTurnsAreRightOrRefused) {
  int refused = 0;
  for (int trial = 0; trial < 12; ++trial) {
    SyntheticScene scene(3000, -3, 4, 0.2, 100 + trial);
    Random random(trial);
    const auto direction = [&] {
      return Eigen::Vector3d(random.Uniform() - 0.5, random.Uniform() - 0.5, random.Uniform() - 0.5).normalized();
    };
    const Eigen::Vector3d axis = direction(), step = 0.02 * direction();
    Initializer initializer({}, scene.Camera(), {});
    std::vector<Rigid3> poses;
    Initialization result;
    for (int i = 0; i < 4; ++i) {
      poses.push_back(Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(0.035 * i, axis)), i * step) * NadirPose(0, 0));
      result = initializer.AddFrame(scene.View(poses.back(), i));
      if (result.success) break;
    }
    if (!result.success) {
      ++refused;
      continue;
    }
    const Rigid3 truth = poses[result.second->index] * poses[result.first->index].Inverse();
    EXPECT_LT(RotationAngle(result.second_from_first.rotation * truth.rotation.conjugate()), 0.01) << trial;
  }
  EXPECT_LT(refused, 6);
}

TEST(Initializer, ImagesOfDifferentPlacesAreRefused) {
  SyntheticScene scene(3000, -10, 10, 0.1, 4);
  Initializer initializer({}, scene.Camera(), {});
  initializer.AddFrame(scene.View(NadirPose(-5, 0), 0));
  const Initialization result = initializer.AddFrame(scene.View(NadirPose(5, 0), 1));
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.reason, LossReason::kTooFewMatches);
}

// A camera that drives forward: the first images soon share nothing with the current one, the last ones have no
// parallax.
TEST(Initializer, FindsThePartnerThatSharesEnough) {
  SyntheticScene scene(6000, -2, 10, 0.25, 5);
  Initializer initializer({}, scene.Camera(), {});
  for (int i = 0; i < 20; ++i) {  // elsewhere, where there is nothing to see
    initializer.AddFrame(scene.View(NadirPose(-8, 0), i));
  }
  std::vector<Rigid3> poses;
  Initialization result;
  for (int i = 0; i < 12 && !result.success; ++i) {
    poses.push_back(NadirPose(0.02 * i, 0.01 * i));
    result = initializer.AddFrame(scene.View(poses.back(), 20 + i));
  }
  ASSERT_TRUE(result.success) << ToString(result.reason);
  ExpectMotion(result, poses[result.first->index - 20], poses.back());
}

// How a beginning over nearly flat ground, seen obliquely from a camera that moves little and turns, compares with the
// truth: the error of the cameras' centres, of the depth, after alignment of the points. None: it was refused.
std::optional<double> ErrorOverFlatGround(const InitializerOptions& options, double relief, double baseline,
                                          int trial) {
  constexpr double kTilt = 0.5, kNoise = 0.5;
  constexpr int kFrames = 5;
  SyntheticScene scene(2500, -2, 2, relief, 500 + trial);
  Initializer initializer(options, scene.Camera(), {});
  Random random(trial);
  const double heading = 2 * M_PI * random.Uniform();
  const Eigen::Vector3d step = baseline / (kFrames - 1) * Eigen::Vector3d(std::cos(heading), std::sin(heading), 0);
  const Eigen::Vector3d axis =
      Eigen::Vector3d(random.Uniform() - 0.5, random.Uniform() - 0.5, random.Uniform() - 0.5).normalized();
  const double turn = 0.06 / (kFrames - 1) * random.Uniform();
  const Eigen::AngleAxisd tilt(kTilt, Eigen::Vector3d::UnitX());
  std::vector<Rigid3> poses;
  Initialization result;
  for (int i = 0; i < kFrames && !result.success; ++i) {
    const Eigen::Quaterniond turned(tilt * Eigen::AngleAxisd(turn * i, axis));
    poses.push_back(Rigid3(turned, Eigen::Vector3d::Zero()) * NadirPose(i * step.x(), i * step.y()));
    result = initializer.AddFrame(scene.View(poses.back(), i, kNoise));
  }
  if (!result.success) return std::nullopt;
  const Rigid3 &first = poses[result.first->index], &second = poses[result.second->index];
  const std::vector<Eigen::Vector3d> shown = scene.Shown(result.first->index);
  std::vector<Eigen::Vector3d> found, truth;
  double depth = 0;
  for (const InitialPoint& p : result.points) {
    found.push_back(p.position);
    truth.push_back(first * shown[p.first_feature]);
    depth += truth.back().z() / static_cast<double>(result.points.size());
  }
  const PointAlignment alignment = AlignPoints(found, truth, AlignmentKind::kSimilarity);
  EXPECT_TRUE(alignment.success);
  const Similarity3& aligned = alignment.to_from_source;
  const Eigen::Vector3d second_center = (second * first.Inverse()).Center();
  return std::max((aligned * Eigen::Vector3d(0, 0, 0)).norm(),
                  (aligned * result.second_from_first.Center() - second_center).norm()) /
         depth;
}

// Two motions explain two images of a plane, and its shallow relief hardly tells them apart: what looks like the better
// one is now and then off by more than the depth. The frames in between know.
TEST(Initializer, BeginningOverNearlyFlatGroundIsRightOrRefused) {
  InitializerOptions two_views;
  two_views.ambiguity_ratio = 2;  // no rival comes near: nothing is asked of frames in between
  int refused = 0, wrong_by_two_views = 0;
  constexpr int kTrials = 16;
  for (const auto& [relief, baseline] : {std::pair(0.01, 0.12), std::pair(0.03, 0.08)}) {
    for (int trial = 0; trial < kTrials; ++trial) {
      const std::optional<double> error = ErrorOverFlatGround({}, relief, baseline, trial);
      if (error) {
        EXPECT_LT(*error, 0.05) << relief << " " << trial;
      } else {
        ++refused;
      }
      wrong_by_two_views += ErrorOverFlatGround(two_views, relief, baseline, trial).value_or(0) > 0.5;
    }
  }
  EXPECT_LE(refused, 2 * kTrials / 3);
  EXPECT_GE(wrong_by_two_views, 3);  // or these scenes say nothing
}

}  // namespace initializer_test
}  // namespace mapmend
