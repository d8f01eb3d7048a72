#include "procs/viewer_export/holes.h"

#include <gtest/gtest.h>

#include <functional>

#include "tests/test_flight.h"

namespace mapmend {
namespace holes_test {

// The model of a flight that ends with this frame; each record may be changed before.
MapModel ModelEnding(const TestFlight& flight, int last_frame, const std::function<void(Record*)>& change = {}) {
  MapModel model;
  for (Record record : flight.Records()) {
    if (std::holds_alternative<SessionEnded>(record.body)) record.header.utime = TestFlight::Utime(last_frame);
    if (change) change(&record);
    EXPECT_EQ(model.Apply(record), "");
  }
  return model;
}

TEST(FindHoles, AMapInOnePieceHasAHoleWhereItBridgesALoss) {
  const TestFlight flight;
  MapModel model = ModelEnding(flight, 44);
  model.SetRevision(flight.Revision());
  const std::vector<MapHole> holes = FindHoles(MakeSnapshot(model));
  ASSERT_EQ(holes.size(), 1u);
  EXPECT_EQ(holes[0].first_frame, 20);
  EXPECT_EQ(holes[0].last_frame, 24);
  EXPECT_EQ(holes[0].num_frames, 5);
  EXPECT_EQ(holes[0].duration_us, TestFlight::Utime(25) - TestFlight::Utime(19));
  EXPECT_EQ(DescribeHoles(holes), "1 hole: frames 20 to 24 (5 frames, 0.6 s)");
}

TEST(FindHoles, FramesOfAnotherPartAreLackingInTheMainMap) {
  TestFlightOptions options;
  options.num_submaps = 3;
  const TestFlight flight(options);
  MapModel model = ModelEnding(flight, 69);
  MapRevision merged = flight.Revision();
  merged.transforms.submaps[0].component = merged.transforms.submaps[2].component = 0;
  merged.transforms.submaps[1].component = 1;
  merged.transforms.submaps[1].is_root = true;
  model.SetRevision(merged);
  const std::vector<MapHole> holes = FindHoles(MakeSnapshot(model));
  ASSERT_EQ(holes.size(), 1u);
  EXPECT_EQ(holes[0].first_frame, 20);
  EXPECT_EQ(holes[0].last_frame, flight.FirstFrame(2) - 1);
}

TEST(FindHoles, TheEndOfTheFlightMayBeLacking) {
  const TestFlight flight;
  MapModel model = ModelEnding(flight, 64);
  model.SetRevision(flight.Revision());
  const std::vector<MapHole> holes = FindHoles(MakeSnapshot(model));
  ASSERT_EQ(holes.size(), 2u);
  EXPECT_EQ(holes[1].first_frame, 45);
  EXPECT_EQ(holes[1].last_frame, -1);
  EXPECT_EQ(holes[1].duration_us, TestFlight::Utime(64) - TestFlight::Utime(44));
}

TEST(FindHoles, WhereEveryOtherFrameIsMappedTheOthersAreNotLacking) {
  const TestFlight flight;
  // Twice as many frames lie in the input: only the even ones were read.
  MapModel model = ModelEnding(flight, 44, [](Record* record) {
    if (auto* keyframe = std::get_if<KeyframeRecord>(&record->body)) keyframe->frame *= 2;
    if (auto* update = std::get_if<MapUpdate>(&record->body)) {
      for (TrackedFrame& frame : update->frames) frame.frame *= 2;
    }
  });
  model.SetRevision(flight.Revision());
  const std::vector<MapHole> holes = FindHoles(MakeSnapshot(model));
  ASSERT_EQ(holes.size(), 1u);
  EXPECT_EQ(holes[0].first_frame, 40);
  EXPECT_EQ(holes[0].last_frame, 48);
  EXPECT_EQ(holes[0].num_frames, 5);
}

TEST(DescribeHoles, NamesTheLongest) {
  EXPECT_EQ(DescribeHoles({}), "no holes");
  EXPECT_EQ(DescribeHoles({{0, 120, -1, 0, 52000000}}), "1 hole: frame 120 to the end (52.0 s)");
  EXPECT_EQ(DescribeHoles({{0, 7, 7, 1, 0}}), "1 hole: frame 7 (1 frame)");
  EXPECT_EQ(DescribeHoles({{0, 7, 7, 1, 66000}, {0, 30, 49, 20, 21000000}, {1, 0, 1, 2, 100000}}),
            "3 holes; the longest: frames 30 to 49 (20 frames, 21 s)");
}

}  // namespace holes_test
}  // namespace mapmend
