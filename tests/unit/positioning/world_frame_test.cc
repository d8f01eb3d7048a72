#include "libs/positioning/world_frame.h"

#include <gtest/gtest.h>

#include <fstream>
#include <stdexcept>

#include "tests/scratch_folder.h"

namespace mapmend {
namespace world_frame_test {

TEST(LocalFrame, ThereAndBack) {
  const LocalFrame frame({28.04, -82.7, 12});
  EXPECT_NEAR(frame.ToEnu({28.04, -82.7, 12}).norm(), 0, 1e-9);
  // A minute of latitude is a nautical mile, nearly.
  EXPECT_NEAR(frame.ToEnu({28.04 + 1 / 60.0, -82.7, 12}).y(), 1847, 3);
  const Eigen::Vector3d enu(120, -340, 56);
  EXPECT_NEAR((frame.ToEnu(frame.ToGeodetic(enu)) - enu).norm(), 0, 1e-6);
}

TEST(UtmFrame, ZoneAndCode) {
  const UtmFrame florida({28.04, -82.7, 0}), chile({-33, -70.5, 0});
  EXPECT_EQ(florida.Epsg(), 32617);
  EXPECT_EQ(florida.Name(), "UTM zone 17 N");
  EXPECT_EQ(chile.Epsg(), 32719);
  const Eigen::Vector3d grid = florida.FromGeodetic({28.04, -82.7, 9});
  EXPECT_NEAR(grid.x(), 332876, 500);
  EXPECT_EQ(grid.z(), 9);
  const Geodetic back = FromUtm(17, true, grid.x(), grid.y());
  EXPECT_NEAR(back.latitude_deg, 28.04, 1e-9);
  EXPECT_NEAR(back.longitude_deg, -82.7, 1e-9);
  // West of the zone's middle (81 W) grid north lies west of north.
  EXPECT_NEAR(florida.ConvergenceDeg({28.04, -82.7, 0}), -0.8, 0.05);
}

TEST(FindOrigin, InTheCommentsOfAFile) {
  const ScratchFolder folder;
  std::ofstream(folder.File("a.tum"))
      << "# t tx ty tz qx qy qz qw\n# metres east, north, up; origin: 28.04 -82.7 5.5\n1 2 3\n";
  std::ofstream(folder.File("b.tum")) << "1 2 3\n# origin: 28.04 -82.7 5.5\n";
  const auto origin = FindOrigin(folder.File("a.tum"));
  ASSERT_TRUE(origin);
  EXPECT_DOUBLE_EQ(origin->longitude_deg, -82.7);
  EXPECT_DOUBLE_EQ(origin->altitude_m, 5.5);
  EXPECT_FALSE(FindOrigin(folder.File("b.tum")));
  EXPECT_FALSE(FindOrigin(folder.File("c.tum")));
}

TEST(ParseGeodetic, GoodAndBad) {
  EXPECT_DOUBLE_EQ(ParseGeodetic("28.04,-82.7", "x").longitude_deg, -82.7);
  EXPECT_DOUBLE_EQ(ParseGeodetic("28.04, -82.7, 12.5", "x").altitude_m, 12.5);
  for (const char* bad : {"", "28", "28,", "28;5", "91,0", "28,5,x", "28,5,6,7"})
    EXPECT_THROW(ParseGeodetic(bad, "--gps-origin"), std::runtime_error) << bad;
}

}  // namespace world_frame_test
}  // namespace mapmend
