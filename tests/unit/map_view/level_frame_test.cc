#include "libs/map_view/level_frame.h"

#include <gtest/gtest.h>

#include "tests/test_flight.h"

namespace mapmend {
namespace level_frame_test {

TEST(PlaceLevel, PutsTheGroundAtZeroUnderTheFirstCamera) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  Snapshot snapshot = MakeSnapshot(model);
  PlaceLevel(0, &snapshot);
  EXPECT_EQ(snapshot.components[0].frame.name, "level");
  EXPECT_EQ(snapshot.components[0].frame.unit, "map units");
  for (const ColoredPoint& point : ComponentPoints(snapshot, 0)) EXPECT_NEAR(point.position.z(), 0, 1e-4);
  for (const MergedFrame& frame : snapshot.components[0].frames) {  // a unit is 10 m
    EXPECT_NEAR(frame.cam_from_root.Center().z(), flight.WorldFromCamera(frame.frame).translation.z() / 10, 1e-4);
  }
  EXPECT_LT(snapshot.components[0].keyframes[0].cam_from_root.Center().head<2>().norm(), 1e-6);
  // As in the picture from above: the strips from left to right, not mirrored.
  const auto center = [&](int i) { return snapshot.components[0].frames[i].cam_from_root.Center(); };
  EXPECT_GT(center(10).x() - center(0).x(), 4.9);
  EXPECT_NEAR(center(10).y(), center(0).y(), 1e-3);
}

}  // namespace level_frame_test
}  // namespace mapmend
