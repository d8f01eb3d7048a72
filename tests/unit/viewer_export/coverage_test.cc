#include "procs/viewer_export/coverage.h"

#include <gtest/gtest.h>

#include <cmath>

namespace mapmend {
namespace coverage_test {

// A square of 10 m around a place, seen from 20 m above.
Footprint Square(double x, double y) {
  Footprint footprint;
  footprint.camera = {x, y, 20};
  footprint.corners = {Eigen::Vector3d(x - 5, y + 5, 0), {x + 5, y + 5, 0}, {x + 5, y - 5, 0}, {x - 5, y - 5, 0}};
  return footprint;
}

// Every place well inside 0 to 60 is seen by nine.
std::vector<Footprint> Survey(double left_out_x = 1e9, double left_out_y = 1e9, double radius = 0) {
  std::vector<Footprint> footprints;
  for (double x = 0; x <= 60; x += 3.3) {
    for (double y = 0; y <= 60; y += 3.3) {
      if (std::hypot(x - left_out_x, y - left_out_y) > radius) footprints.push_back(Square(x, y));
    }
  }
  return footprints;
}

TEST(Coverage, OfOneImage) {
  const Coverage coverage = MeasureCoverage({Square(0, 0)}, {});
  EXPECT_NEAR(coverage.area_seen, 100, 4);
  EXPECT_EQ(coverage.area_enough, 0);
  EXPECT_TRUE(coverage.regions.empty());  // all of it is edge
}

TEST(Coverage, AWholeSurveyHasNothingToFlyAgain) {
  const Coverage coverage = MeasureCoverage(Survey(), {});
  EXPECT_NEAR(coverage.area_seen, 69.4 * 69.4, 60);
  EXPECT_GT(coverage.area_few, 100);  // its edges
  EXPECT_TRUE(coverage.regions.empty());
}

TEST(Coverage, AHoleIsFoundWithItsAreaAndOutline) {
  const Coverage coverage = MeasureCoverage(Survey(30, 30, 12), {});
  ASSERT_EQ(coverage.regions.size(), 1u);
  const CoverageRegion& region = coverage.regions[0];
  EXPECT_EQ(region.fewest_images, 0);
  EXPECT_NEAR((region.center - Eigen::Vector2d(30, 30)).norm(), 0, 1.5);
  EXPECT_GT(region.area, region.area_unseen);
  EXPECT_GT(region.area_unseen, 50);
  EXPECT_LT(region.area, 24 * 24);
  ASSERT_EQ(region.rings.size(), 1u);
  double twice = 0;
  for (size_t i = 0; i < region.rings[0].size(); ++i) {
    const Eigen::Vector2d &a = region.rings[0][i], &b = region.rings[0][(i + 1) % region.rings[0].size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  EXPECT_NEAR(twice / 2, region.area, 1e-6);  // counter-clockwise, around all of it
}

TEST(Coverage, ThinGroundIsFoundWithoutAHole) {
  std::vector<Footprint> footprints = Survey(30, 30, 12);
  footprints.push_back(Square(25, 25));
  footprints.push_back(Square(35, 25));
  footprints.push_back(Square(25, 35));
  footprints.push_back(Square(35, 35));
  const Coverage coverage = MeasureCoverage(footprints, {});
  ASSERT_FALSE(coverage.regions.empty());
  EXPECT_GE(coverage.regions[0].fewest_images, 1);
  EXPECT_EQ(coverage.regions[0].area_unseen, 0);
}

TEST(Coverage, WhatLiesAroundAnIslandHasTwoRings) {
  std::vector<Footprint> footprints = Survey(30, 30, 20);
  for (int i = 0; i < 4; ++i) footprints.push_back(Square(30, 30));
  const Coverage coverage = MeasureCoverage(footprints, {});
  ASSERT_EQ(coverage.regions.size(), 1u);
  EXPECT_EQ(coverage.regions[0].rings.size(), 2u);
}

TEST(Coverage, ABayOfTheOutlineIsNoHole) {
  std::vector<Footprint> footprints = Survey();
  std::erase_if(footprints, [](const Footprint& f) { return f.camera.x() > 30 && f.camera.y() > 30; });  // an L
  EXPECT_TRUE(MeasureCoverage(footprints, {}).regions.empty());
}

TEST(Coverage, Nothing) { EXPECT_TRUE(MeasureCoverage({}, {}).counts.empty()); }

}  // namespace coverage_test
}  // namespace mapmend
