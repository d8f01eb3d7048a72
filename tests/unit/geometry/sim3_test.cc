#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "libs/geometry/sim3_closed_form.h"
#include "libs/geometry/sim3_ransac.h"
#include "libs/geometry/sim3_refinement.h"

namespace mapmend {
namespace sim3_test {

double Uniform(std::mt19937_64* random, double low, double high) {
  return low + (high - low) * static_cast<double>((*random)() >> 11) * 0x1.0p-53;
}

Eigen::Vector3d RandomVector(std::mt19937_64* random, double size) {
  return {Uniform(random, -size, size), Uniform(random, -size, size), Uniform(random, -size, size)};
}

Similarity3 Truth() {
  return {2.5, Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, -2, 0.5).normalized())),
          Eigen::Vector3d(4, -1, 2)};
}

TEST(HornAlignment, RecoversAKnownSimilarity) {
  // By hand: scale 2, quarter turn about z (x -> y), shift (1, 0, 0).
  const std::vector<Eigen::Vector3d> a = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<Eigen::Vector3d> b = {{1, 0, 0}, {1, 2, 0}, {-1, 0, 0}};
  const auto t = HornAlignment(a, b);
  ASSERT_TRUE(t);
  EXPECT_NEAR(t->scale, 2, 1e-12);
  EXPECT_LT((t->translation - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
  EXPECT_LT((t->rotation * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-12);
}

TEST(HornAlignment, IsSymmetricUnderNoise) {
  std::mt19937_64 random(1);
  std::vector<Eigen::Vector3d> a, b;
  for (int i = 0; i < 20; ++i) {
    a.push_back(RandomVector(&random, 3));
    b.push_back(Truth() * a.back() + RandomVector(&random, 0.3));
  }
  const Similarity3 round_trip = *HornAlignment(b, a) * *HornAlignment(a, b);
  EXPECT_NEAR(round_trip.scale, 1, 1e-12);
  EXPECT_LT(RotationAngle(round_trip.rotation), 1e-7);
}

TEST(HornAlignment, RefusesPointsOnALine) {
  EXPECT_FALSE(HornAlignment({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}));
  EXPECT_FALSE(HornAlignment({{0, 0, 0}, {1, 1, 1}}, {{0, 0, 0}, {1, 0, 0}}));
  EXPECT_FALSE(HornAlignment({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}}));
}

TEST(HornAlignment, NeverReflects) {
  const std::vector<Eigen::Vector3d> a = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  std::vector<Eigen::Vector3d> b = a;
  for (auto& x : b) x.x() = -x.x();
  EXPECT_NEAR(HornAlignment(a, b)->rotation.toRotationMatrix().determinant(), 1, 1e-12);
}

TEST(HornAlignment, WeightsCountLikeRepetition) {
  std::mt19937_64 random(11);
  std::vector<Eigen::Vector3d> a, b, repeated_a, repeated_b;
  std::vector<double> weights;
  for (int i = 0; i < 10; ++i) {
    a.push_back(RandomVector(&random, 3));
    b.push_back(Truth() * a.back() + RandomVector(&random, 0.3));
    weights.push_back(1 + i % 3);
    for (int k = 0; k <= i % 3; ++k) {
      repeated_a.push_back(a.back());
      repeated_b.push_back(b.back());
    }
  }
  const Similarity3 weighted = *HornAlignment(a, b, weights), repeated = *HornAlignment(repeated_a, repeated_b);
  EXPECT_NEAR(weighted.scale, repeated.scale, 1e-12);
  EXPECT_LT((weighted.translation - repeated.translation).norm(), 1e-12);
}

// Points of a submap, and where a refinement has moved them: errors in proportion to the distance.
struct MovedPoints {
  std::vector<Eigen::Vector3d> a, b;

  explicit MovedPoints(double error) {
    std::mt19937_64 random(12);
    for (int i = 0; i < 300; ++i) {
      a.push_back(RandomVector(&random, 3) * (i % 10 == 0 ? 10 : 1));
      b.push_back(Truth() * (a.back() + RandomVector(&random, error * a.back().norm())));
    }
  }
};

TEST(RobustAlignment, IsExactOnExactPoints) {
  const MovedPoints points(0);
  const Similarity3 fit = *RobustAlignment(points.a, points.b);
  EXPECT_NEAR(fit.scale, Truth().scale, 1e-12);
  EXPECT_LT((fit.translation - Truth().translation).norm(), 1e-11);
}

TEST(RobustAlignment, OnePointFarAwayDoesNotDecide) {
  MovedPoints points(0.01);
  points.b[17] = Truth() * (points.a[17] * 3000);  // nearly parallel rays
  EXPECT_GT(HornAlignment(points.a, points.b)->scale / Truth().scale, 2);
  const Similarity3 fit = *RobustAlignment(points.a, points.b);
  EXPECT_NEAR(fit.scale / Truth().scale, 1, 0.005);
  EXPECT_LT(RotationAngle(fit.rotation * Truth().rotation.conjugate()), 0.003);
  const Similarity3 back = *RobustAlignment(points.b, points.a);
  EXPECT_NEAR(back.scale * fit.scale, 1, 0.001) << "the far point may be on either side";
}

TEST(RobustAlignment, AThirdOfThePointsMayBeAnywhere) {
  MovedPoints points(0.01);
  std::mt19937_64 random(13);
  for (size_t i = 0; i < points.b.size(); i += 3) points.b[i] = RandomVector(&random, 50);
  const Similarity3 fit = *RobustAlignment(points.a, points.b);
  EXPECT_NEAR(fit.scale / Truth().scale, 1, 0.01);
  EXPECT_LT(RotationAngle(fit.rotation * Truth().rotation.conjugate()), 0.01);
}

TEST(RobustAlignment, RefusesWhatDeterminesNothing) {
  EXPECT_FALSE(RobustAlignment({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}));
  EXPECT_FALSE(RobustAlignment({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}}));
  EXPECT_FALSE(RobustAlignment({}, {}));
}

// A scene seen in front of one camera of each submap.
struct Scene {
  Pinhole camera{600, 620, 320, 240, 640, 480};
  Rigid3 cam_from_a, cam_from_b;
  std::vector<PointMatch> matches;

  Scene(int count, double pixel_noise, uint64_t seed) {
    std::mt19937_64 random(seed);
    cam_from_a = Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX())), {0.2, 0.1, 8});
    // b's camera stands half a metre (of a) aside and rolled by 100 degrees.
    const Rigid3 camb_from_cama(Eigen::Quaterniond(Eigen::AngleAxisd(1.75, Eigen::Vector3d::UnitZ())), {0.5, 0.2, 0.3});
    cam_from_b = TransformWorld(camb_from_cama * cam_from_a, Truth());
    const auto noise = [&]() -> Eigen::Vector2d {
      return Eigen::Vector2d(Uniform(&random, -pixel_noise, pixel_noise), Uniform(&random, -pixel_noise, pixel_noise));
    };
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d a = RandomVector(&random, 1.5), b = Truth() * a;
      matches.push_back({{a, cam_from_b, camera, camera.Project(cam_from_b * b) + noise(), 1.2},
                         {b, cam_from_a, camera, camera.Project(cam_from_a * a) + noise(), 1.0}});
    }
  }
};

void ExpectNear(const Similarity3& actual, const Similarity3& expected, double tolerance) {
  EXPECT_NEAR(actual.scale / expected.scale, 1, tolerance);
  EXPECT_LT(RotationAngle(actual.rotation * expected.rotation.conjugate()), tolerance);
  EXPECT_LT((actual.translation - expected.translation).norm(), 5 * tolerance);
}

TEST(EstimateSim3, FindsTheTransformAmongTwoThirdsOutliers) {
  Scene scene(120, 0.5, 5);
  std::mt19937_64 random(9);
  for (size_t i = 40; i < scene.matches.size(); ++i) {
    // A wrong match: b's point and the pixels belong to something else.
    scene.matches[i].b_in_a.point = Truth() * RandomVector(&random, 1.5);
    scene.matches[i].a_in_b.pixel = Eigen::Vector2d(Uniform(&random, 0, 640), Uniform(&random, 0, 480));
  }
  const Sim3RansacResult result = EstimateSim3(scene.matches, {});
  ASSERT_TRUE(result.success);
  EXPECT_GE(result.num_inliers, 40);
  EXPECT_LE(result.num_inliers, 42);
  ExpectNear(result.b_from_a, Truth(), 0.01);
}

TEST(EstimateSim3, FailsOnNoise) {
  Scene scene(60, 0, 6);
  std::mt19937_64 random(10);
  for (PointMatch& m : scene.matches) {
    m.b_in_a.point = Truth() * RandomVector(&random, 1.5);
    m.a_in_b.pixel = Eigen::Vector2d(Uniform(&random, 0, 640), Uniform(&random, 0, 480));
  }
  EXPECT_FALSE(EstimateSim3(scene.matches, {}).success);
}

TEST(Sim3Refinement, JacobiansAreTheNumericDerivatives) {
  const Scene scene(10, 3, 7);
  const Similarity3 t = Perturb(Truth(), (Vector7d() << 0.02, -0.01, 0.03, 0.1, -0.05, 0.07, 0.04).finished());
  constexpr double h = 1e-6;
  for (const PointMatch& m : scene.matches) {
    for (const bool a_in_b : {true, false}) {
      const auto residual = [&](const Similarity3& s, Eigen::Vector2d* r, Eigen::Matrix<double, 2, 7>* J) {
        return a_in_b ? ResidualAInB(m.a_in_b, s, r, J) : ResidualBInA(m.b_in_a, s, r, J);
      };
      const auto at = [&](const Vector7d& d) -> Eigen::Vector2d {
        Eigen::Vector2d r(NAN, NAN);
        residual(Perturb(t, d), &r, nullptr);
        return r;
      };
      Eigen::Vector2d r;
      Eigen::Matrix<double, 2, 7> J;
      ASSERT_TRUE(residual(t, &r, &J));
      for (int i = 0; i < 7; ++i) {
        Vector7d d = Vector7d::Zero();
        d(i) = h;
        EXPECT_LT((J.col(i) - (at(d) - at(-d)) / (2 * h)).norm(), 1e-4 * (1 + J.col(i).norm()))
            << "parameter " << i << " way " << a_in_b;
      }
    }
  }
}

TEST(Sim3Refinement, JacobianOfAPlaceIsTheNumericDerivative) {
  const Similarity3 t = Perturb(Truth(), (Vector7d() << 0.02, -0.01, 0.03, 0.1, -0.05, 0.07, 0.04).finished());
  const Eigen::Vector3d point(3, -2, 7);
  constexpr double h = 1e-6;
  const Eigen::Matrix<double, 3, 7> J = PlaceJacobian(t, point);
  for (int i = 0; i < 7; ++i) {
    Vector7d d = Vector7d::Zero();
    d(i) = h;
    EXPECT_LT((J.col(i) - (Perturb(t, d) * point - Perturb(t, -d) * point) / (2 * h)).norm(), 1e-6) << i;
  }
}

TEST(Sim3Refinement, DifferenceInvertsPerturb) {
  const Vector7d d = (Vector7d() << 0.4, -0.2, 0.3, 1, -2, 0.5, -0.3).finished();
  EXPECT_LT((Difference(Truth(), Perturb(Truth(), d)) - d).norm(), 1e-12);
}

TEST(Sim3Refinement, ConvergesFromAPoorStartInSpiteOfOutliers) {
  Scene scene(100, 0.5, 8);
  std::mt19937_64 random(11);
  CrossObservations observations;
  for (size_t i = 0; i < scene.matches.size(); ++i) {
    if (i % 5 == 0) scene.matches[i].a_in_b.pixel = Eigen::Vector2d(Uniform(&random, 0, 640), Uniform(&random, 0, 480));
    observations.a_in_b.push_back(scene.matches[i].a_in_b);
    observations.b_in_a.push_back(scene.matches[i].b_in_a);
  }
  const Similarity3 start = Perturb(Truth(), (Vector7d() << 0.03, -0.02, 0.03, 0.2, -0.2, 0.1, 0.03).finished());
  const Sim3RefinementResult result = RefineSim3(observations, start, {});
  ASSERT_TRUE(result.success);
  ExpectNear(result.b_from_a, Truth(), 0.002);
  EXPECT_GE(result.num_inliers, 178);
  EXPECT_LE(result.num_inliers, 182);
  EXPECT_LT(result.final_cost, result.initial_cost);
  EXPECT_LT(result.median_error_px, 0.7);
}

TEST(Sim3Refinement, InformationPredictsTheErrorOfTheEstimate) {
  // Errors of the estimate over many noise draws, whitened by its own information, have variance near 1.
  double sum = 0;
  constexpr int kRuns = 60;
  for (int run = 0; run < kRuns; ++run) {
    const Scene scene(40, 1.0, 100 + run);  // uniform in [-1, 1]: variance 1/3
    CrossObservations observations;
    for (PointMatch m : scene.matches) {
      m.a_in_b.sigma = m.b_in_a.sigma = std::sqrt(1.0 / 3);
      observations.a_in_b.push_back(m.a_in_b);
      observations.b_in_a.push_back(m.b_in_a);
    }
    const Sim3RefinementResult result = RefineSim3(observations, Truth(), {});
    const Vector7d d = Difference(result.b_from_a, Truth());
    sum += d.dot(result.information * d) / 7;
  }
  EXPECT_NEAR(sum / kRuns, 1, 0.25);
}

}  // namespace sim3_test
}  // namespace mapmend
