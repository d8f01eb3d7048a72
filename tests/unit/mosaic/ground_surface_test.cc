#include "libs/mosaic/ground_surface.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libs/base/random.h"

namespace mapmend {
namespace ground_surface_test {

std::vector<Eigen::Vector3d> Sampled(const std::function<double(double, double)>& height, int count) {
  Random random(3);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double x = 100 * random.Uniform(), y = 60 * random.Uniform();
    points.emplace_back(x, y, height(x, y));
  }
  return points;
}

const GroundBounds kBounds{{0, 0}, {100, 60}};

TEST(GroundSurface, FollowsAHill) {
  const auto hill = [](double x, double y) { return 8 * std::exp(-((x - 40) * (x - 40) + (y - 30) * (y - 30)) / 400); };
  const GroundSurface surface(Sampled(hill, 6000), kBounds, {});
  for (double x = 10; x < 95; x += 7) {
    for (double y = 5; y < 58; y += 7) EXPECT_NEAR(surface.Height(x, y), hill(x, y), 0.35) << x << " " << y;
  }
  EXPECT_LT(surface.MedianResidual(), 0.2);
}

TEST(GroundSurface, WrongPointsDoNotMoveIt) {
  std::vector<Eigen::Vector3d> points = Sampled([](double x, double) { return 0.05 * x; }, 4000);
  Random random(4);
  for (size_t i = 0; i < points.size(); i += 5) points[i].z() += 40 * random.Uniform();
  for (int i = 0; i < 40; ++i) points.emplace_back(50 + random.Uniform(), 30 + random.Uniform(), 300);  // one cell
  const GroundSurface surface(points, kBounds, {});
  for (double x = 10; x < 95; x += 5) EXPECT_NEAR(surface.Height(x, 30), 0.05 * x, 0.4) << x;
}

TEST(GroundSurface, HolesAreFilledFromTheirBorder) {
  std::vector<Eigen::Vector3d> points = Sampled([](double x, double y) { return 0.1 * x - 0.05 * y; }, 4000);
  std::erase_if(points,
                [](const Eigen::Vector3d& p) { return std::abs(p.x() - 50) < 12 && std::abs(p.y() - 30) < 12; });
  const GroundSurface surface(points, kBounds, {});
  EXPECT_NEAR(surface.Height(50, 30), 3.5, 0.5);
}

TEST(GroundSurface, GoesOnHorizontallyOutside) {
  const GroundSurface surface(Sampled([](double, double) { return 7; }, 500), kBounds, {});
  EXPECT_NEAR(surface.Height(-1000, 500), 7, 1e-6);
}

TEST(GroundSurface, WithoutPointsIsAPlane) {
  EXPECT_EQ(GroundSurface({}, kBounds, {}).Height(3, 4), 0);
  EXPECT_EQ(GroundSurface(5).Height(3, 4), 5);
}

}  // namespace ground_surface_test
}  // namespace mapmend
