#include "procs/viewer_export/restoration.h"

#include <gtest/gtest.h>

#include "tests/test_flight.h"

namespace mapmend {
namespace restoration_test {

// Submaps of 20 frames with a keyframe every 4.
KeyframeId KeyframeAt(int submap, int frame_in_submap) { return KeyframeId(5 * submap + frame_in_submap / 4); }

RestorationTable TableOf(const TestFlight& flight, const MapRevision& revision) {
  MapModel model = MakeModel(flight);
  model.SetRevision(revision);
  return MakeRestorationTable(MakeSnapshot(model));
}

TEST(Restoration, AMergeStandsAtTheFirstFrameOfTheYoungerSubmapThatIsConnected) {
  const TestFlight flight;
  MapRevision revision = flight.Revision();
  ASSERT_EQ(revision.connections.size(), 1u);
  revision.connections[0].pairs = {{KeyframeAt(0, 4), KeyframeAt(1, 12), 60},
                                   {KeyframeAt(0, 16), KeyframeAt(1, 8), 40}};
  const RestorationTable table = TableOf(flight, revision);
  ASSERT_EQ(table.steps.size(), 3u);
  EXPECT_EQ(table.steps[1].frame, flight.FirstFrame(1));
  EXPECT_EQ(table.steps[1].lost, 0);
  EXPECT_EQ(table.steps[2].event, RestorationStep::Event::kMerge);
  EXPECT_EQ(table.steps[2].frame, flight.FirstFrame(1) + 8);
  EXPECT_EQ(StackLetters(table.steps[2].tracked), "B-A");
}

TEST(Restoration, OnlyAcceptedConnectionsMerge) {
  const TestFlight flight;
  MapRevision revision = flight.Revision();
  revision.connections[0].verdict = EvaluatedConnection::Verdict::kDeactivated;
  const RestorationTable table = TableOf(flight, revision);
  ASSERT_EQ(table.steps.size(), 2u);
  EXPECT_EQ(StackLetters(table.steps[1].unrecovered), "A");
}

TEST(Restoration, StacksAreThoseOfTheLastStep) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  MapRevision revision = flight.Revision();
  model.SetRevision(revision);
  EXPECT_EQ(DescribeStacks(MakeSnapshot(model)), "L1 –; L2 B-A");
  ++revision.transforms.revision;
  revision.connections[0].verdict = EvaluatedConnection::Verdict::kRejected;
  model.SetRevision(revision);
  EXPECT_EQ(DescribeStacks(MakeSnapshot(model)), "L1 A; L2 B");
  EXPECT_EQ(DescribeStacks(MakeSnapshot(MapModel())), "");
}

// The connection came over the bus before the records of its keyframes.
TEST(Restoration, AKeyframeThatIsNotKnownYetTellsNoTime) {
  const TestFlight flight;
  MapRevision revision = flight.Revision();
  revision.connections[0].pairs = {{KeyframeId(0), KeyframeId(1000), 60}};
  const RestorationTable table = TableOf(flight, revision);
  ASSERT_EQ(table.steps.size(), 3u);
  EXPECT_EQ(table.steps[2].utime, TestFlight::Utime(flight.FirstFrame(1) + 19));
}

}  // namespace restoration_test
}  // namespace mapmend
