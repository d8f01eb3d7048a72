#include "libs/optim/pose_uncertainty.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "libs/base/random.h"

namespace mapmend {
namespace pose_uncertainty_test {

const Pinhole kCamera{480, 480, 400, 300, 800, 600};

// Sum of uniforms: near enough to a normal distribution, and the same everywhere.
double Gauss(Random* random) {
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += random->Uniform();
  return sum;
}

// What it says is how far optimised poses scatter about the truth.
TEST(PoseUncertainty, IsTheScatterOfPoses) {
  Random random(2);
  std::vector<PoseObservation> exact;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d x(2 * random.Uniform() - 1, 1.4 * random.Uniform() - 0.7, 2 + 0.2 * random.Uniform());
    exact.push_back({x, kCamera.Project(x), 1.0});
  }
  const double sigma = RelativePositionSigma(kCamera, {}, exact);
  constexpr int kTrials = 200;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (int t = 0; t < kTrials; ++t) {
    std::vector<PoseObservation> noisy = exact;
    for (PoseObservation& o : noisy) o.pixel += Eigen::Vector2d(Gauss(&random), Gauss(&random));
    PoseOptimizationOptions options;
    options.huber = 0;
    options.outlier_chi2 = 1e9;
    const PoseOptimizationResult result = OptimizePose(kCamera, {}, noisy, options);
    ASSERT_TRUE(result.success);
    const Eigen::Vector3d center = result.cam_from_world.Center();
    scatter += center * center.transpose() / kTrials;
  }
  const double measured =
      std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvalues()[2]) / 2.1;  // the median depth
  // A tenth of the observations, those that tell most, does not count.
  EXPECT_GT(sigma, measured);
  EXPECT_LT(sigma, 1.6 * measured);
}

// A far and narrow group of points leaves open whether the camera has turned or moved. Two near ones would tell, but if
// they are wrong, so is the pose.
TEST(PoseUncertainty, AFewNearPointsAreNotTrusted) {
  Random random(3);
  std::vector<PoseObservation> observations;
  const auto add = [&](const Eigen::Vector3d& x) { observations.push_back({x, kCamera.Project(x), 1.0}); };
  for (int i = 0; i < 70; ++i)
    add({2 * random.Uniform() - 1, 1.5 * random.Uniform() - 0.5, 7.5 + 0.5 * random.Uniform()});
  EXPECT_GT(RelativePositionSigma(kCamera, {}, observations), 0.0125);
  add({0.8, 0.5, 2});
  add({0.6, 0.2, 2.2});
  EXPECT_GT(RelativePositionSigma(kCamera, {}, observations), 0.0125);
  for (int i = 0; i < 40; ++i) add({random.Uniform() - 0.5, random.Uniform() - 0.5, 2 + random.Uniform()});
  EXPECT_LT(RelativePositionSigma(kCamera, {}, observations), 0.005);
}

// Two exact near points hide the influence of a third that is known less well; it would still hold the pose when they
// are gone.
TEST(PoseUncertainty, PointsThatHideBehindOthersAreNotTrustedEither) {
  Random random(3);
  std::vector<PoseObservation> observations;
  const auto add = [&](const Eigen::Vector3d& x, double sigma) {
    observations.push_back({x, kCamera.Project(x), sigma});
  };
  for (int i = 0; i < 45; ++i)
    add({1.4 * random.Uniform(), 1.2 * random.Uniform() - 0.6, 7.3 + 0.4 * random.Uniform()}, 1);
  const double without = RelativePositionSigma(kCamera, {}, observations);
  EXPECT_GT(without, 0.0125);
  add({-0.6, -0.25, 0.8}, 1);
  add({-0.4, -0.2, 1.5}, 1);
  add({-0.37, -0.21, 1.5}, 4);
  EXPECT_GT(RelativePositionSigma(kCamera, {}, observations), 0.8 * without);
}

TEST(PoseUncertainty, ACornerFoundAtManyOctavesCountsOnce) {
  Random random(4);
  std::vector<PoseObservation> once, often;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d x(2 * random.Uniform() - 1, 1.4 * random.Uniform() - 0.7, 2 + 0.2 * random.Uniform());
    // In the middle of a cell of a hundredth of the image, where its copies do not fall into another.
    const Eigen::Vector2d pixel = (kCamera.Project(x) / 10).array().floor() * 10 + 5;
    once.push_back({2 * kCamera.Unproject(pixel), pixel, 1.0});
    for (int copy = 0; copy < 4; ++copy) often.push_back(once.back());
  }
  EXPECT_NEAR(RelativePositionSigma(kCamera, {}, often) / RelativePositionSigma(kCamera, {}, once), 1, 0.02);
}

TEST(PoseUncertainty, PointsThatFixNothingAreInfinitelyUncertain) {
  EXPECT_TRUE(std::isinf(RelativePositionSigma(kCamera, {}, {})));
  const Eigen::Vector3d x(0.1, 0.1, 2);
  const PoseObservation same{x, kCamera.Project(x), 1.0};
  EXPECT_GT(RelativePositionSigma(kCamera, {}, std::vector<PoseObservation>(20, same)), 1.0);
}

}  // namespace pose_uncertainty_test
}  // namespace mapmend
