#include <gtest/gtest.h>

#include "libs/base/random.h"
#include "libs/geometry/pnp.h"
#include "libs/geometry/triangulation.h"
#include "libs/geometry/two_view.h"

namespace mapmend {
namespace two_view_pnp_test {

const Pinhole kCamera{480, 480, 400, 300, 800, 600};

struct TwoViews {
  Rigid3 second_from_first;
  std::vector<Eigen::Vector2d> first, second;
  std::vector<Eigen::Vector3d> points;
};

// Exact views of a plane (relief = 0) or of a rough scene.
TwoViews MakeViews(double relief, const Rigid3& second_from_first) {
  TwoViews views;
  views.second_from_first = second_from_first;
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d x(random.Uniform() - 0.5, random.Uniform() - 0.5, 1.0 + relief * (random.Uniform() - 0.5));
    views.points.push_back(x);
    views.first.push_back((x / x.z()).head<2>());
    const Eigen::Vector3d y = second_from_first * x;
    views.second.push_back((y / y.z()).head<2>());
  }
  return views;
}

bool ContainsTruth(const std::vector<TwoViewHypothesis>& hypotheses, const Rigid3& truth, TwoViewModel model) {
  for (const TwoViewHypothesis& h : hypotheses) {
    if (h.model == model && RotationAngle(h.second_from_first.rotation * truth.rotation.conjugate()) < 1e-3 &&
        (h.second_from_first.translation - truth.translation.normalized()).norm() < 1e-2) {
      return true;
    }
  }
  return false;
}

TEST(TwoView, HomographyHoldsTheTruthOnAPlaneWithOutliers) {
  const Rigid3 truth(Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d(0.3, 0.1, 1).normalized())),
                     {0.2, 0.05, 0.02});
  TwoViews views = MakeViews(0, truth);
  for (size_t i = 0; i < views.second.size(); i += 4) views.second[i].x() += 0.1;
  const auto hypotheses = ProposeTwoViewMotions(views.first, views.second, 1.0 / 480, 1);
  EXPECT_TRUE(ContainsTruth(hypotheses, truth, TwoViewModel::kHomography));
}

TEST(TwoView, EssentialHoldsTheTruthInARoughScene) {
  const Rigid3 truth(Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY())), {0.2, -0.1, 0.1});
  const TwoViews views = MakeViews(0.8, truth);
  const auto hypotheses = ProposeTwoViewMotions(views.first, views.second, 1.0 / 480, 1);
  EXPECT_TRUE(ContainsTruth(hypotheses, truth, TwoViewModel::kEssential));
}

TEST(TwoView, TooFewMatchesGiveNothing) { EXPECT_TRUE(ProposeTwoViewMotions({{0, 0}}, {{0, 0}}, 0.01, 1).empty()); }

TEST(Triangulation, ExactRaysGiveTheExactPoint) {
  const Rigid3 b_from_a(Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX())), {0.3, 0.1, 0});
  const Eigen::Vector3d x(0.2, -0.1, 2.0);
  const Eigen::Vector3d y = b_from_a * x;
  const auto point = Triangulate(x / x.z(), y / y.z(), b_from_a);
  ASSERT_TRUE(point.has_value());
  EXPECT_LT((*point - x).norm(), 1e-10);
  // The same rays with the baseline reversed meet behind the cameras.
  Rigid3 reversed = b_from_a;
  reversed.translation *= -1;
  EXPECT_FALSE(Triangulate(x / x.z(), y / y.z(), reversed).has_value());
}

TEST(Pnp, FindsThePoseAmongSixtyPercentOutliers) {
  const Rigid3 truth(Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.1, 0.2, 1).normalized())),
                     {0.1, 0.2, 0.3});
  const TwoViews views = MakeViews(0.3, truth);
  std::vector<Eigen::Vector2d> pixels;
  Random random(5);
  for (size_t i = 0; i < views.points.size(); ++i) {
    pixels.push_back(kCamera.Project(truth * views.points[i]));
    if (i % 5 < 3) pixels.back() = {800 * random.Uniform(), 600 * random.Uniform()};
  }
  const PnpResult result = SolvePnpRansac(kCamera, views.points, pixels, std::vector<double>(pixels.size(), 1.0), {});
  ASSERT_TRUE(result.success);
  EXPECT_GE(result.num_inliers, 80);
  EXPECT_LT((result.cam_from_world.Center() - truth.Center()).norm(), 1e-4);
}

}  // namespace two_view_pnp_test
}  // namespace mapmend
