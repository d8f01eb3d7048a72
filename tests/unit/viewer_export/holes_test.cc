#include "procs/viewer_export/holes.h"

#include <gtest/gtest.h>

#include "tests/unit/viewer_export/test_flight.h"

namespace mapmend {
namespace {

TEST(FindHoles, AMapInOnePieceHasAHoleWhereItBridgesALoss) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  const std::vector<MapHole> holes = FindHoles(MakeSnapshot(model));
  ASSERT_EQ(holes.size(), 1u);
  EXPECT_EQ(holes[0].first_frame, 20);
  EXPECT_EQ(holes[0].last_frame, 24);
  EXPECT_EQ(holes[0].duration_us, TestFlight::Utime(25) - TestFlight::Utime(19));
  EXPECT_EQ(DescribeHoles(holes), "1 hole: frames 20 to 24 (5 frames, 0.6 s)");
}

TEST(FindHoles, FramesOfAnotherPartAreLackingInTheMainMap) {
  TestFlightOptions options;
  options.num_submaps = 3;
  const TestFlight flight(options);
  MapModel model = MakeModel(flight);
  MapRevision merged = flight.Revision();
  merged.submaps[0].component = merged.submaps[2].component = 0;
  merged.submaps[1].component = 1;
  merged.submaps[1].is_root = true;
  model.SetRevision(merged);
  const std::vector<MapHole> holes = FindHoles(MakeSnapshot(model));
  ASSERT_EQ(holes.size(), 1u);
  EXPECT_EQ(holes[0].first_frame, 20);
  EXPECT_EQ(holes[0].last_frame, flight.FirstFrame(2) - 1);
}

TEST(DescribeHoles, NamesTheLongest) {
  EXPECT_EQ(DescribeHoles({}), "no holes");
  EXPECT_EQ(DescribeHoles({{0, 7, 7, 0}}), "1 hole: frame 7 (1 frame)");
  EXPECT_EQ(DescribeHoles({{0, 7, 7, 66000}, {0, 30, 49, 21000000}, {1, 0, 1, 0}}),
            "3 holes, 23 frames in all; the longest: frames 30 to 49 (20 frames, 21 s)");
}

}  // namespace
}  // namespace mapmend
