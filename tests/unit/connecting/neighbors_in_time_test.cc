#include "libs/connecting/neighbors_in_time.h"

#include <gtest/gtest.h>

#include "tests/merger_fixture.h"

namespace mapmend {
namespace neighbors_in_time_test {

using testing::Frame;
using testing::Recorder;
using testing::Strip;
using testing::SyntheticFlight;
using testing::Terrain;

class SilentBow : public BowSource {
 public:
  std::vector<BowProposal> Query(const BowQuestion&) override { return {}; }
};

// Submaps 0, 1, 2 with 8, 3 and 8 keyframes. 1 lies elsewhere; 2 begins where 0 ended.
SyntheticFlight InterruptedTwice() {
  std::mt19937_64 random(81);
  SyntheticFlight flight("s", 0, Terrain(), {});
  flight.AddSubmap(Strip({80, 100}, {220, 100}, 100, 8, 90, &random), Frame(0.02, 0.3));
  flight.AddSubmap(Strip({320, 320}, {340, 320}, 100, 3, 90, &random), Frame(0.05, -0.9));
  flight.AddSubmap(Strip({225, 110}, {225, 250}, 100, 8, 0, &random), Frame(0.01, 2.0));
  flight.End();
  return flight;
}

TEST(NeighborsInTime, AreTheLastKeyframesOfTheTwoSubmapsBefore) {
  const Session session = InterruptedTwice().Model();
  const auto neighbors = NeighborsInTime(session, SubmapId(2), KeyframeId(11), {});
  ASSERT_EQ(neighbors.size(), 2u);
  EXPECT_EQ(neighbors[0].first, SubmapId(1));
  EXPECT_EQ(neighbors[0].second, (std::vector<KeyframeId>{KeyframeId(10), KeyframeId(9), KeyframeId(8)}));
  EXPECT_EQ(neighbors[1].first, SubmapId(0));
  EXPECT_EQ(neighbors[1].second,
            (std::vector<KeyframeId>{KeyframeId(7), KeyframeId(6), KeyframeId(5), KeyframeId(4), KeyframeId(3)}));
}

TEST(NeighborsInTime, OnlyTheFirstKeyframesHaveThem) {
  const Session session = InterruptedTwice().Model();
  EXPECT_EQ(NeighborsInTime(session, SubmapId(2), KeyframeId(15), {}).size(), 2u);  // the fifth
  EXPECT_TRUE(NeighborsInTime(session, SubmapId(2), KeyframeId(16), {}).empty());
  EXPECT_TRUE(NeighborsInTime(session, SubmapId(0), KeyframeId(0), {}).empty());
}

TEST(NeighborsInTime, GoByTheTimeOfTheImagesNotByTheirNumbers) {
  Session session = InterruptedTwice().Model();
  auto& keyframes = session.submaps.at(SubmapId(2)).keyframes;
  keyframes.at(KeyframeId(18)).utime = keyframes.at(KeyframeId(11)).utime - 1;  // tracked backwards, and so made late
  EXPECT_EQ(NeighborsInTime(session, SubmapId(2), KeyframeId(18), {}).size(), 2u);
  EXPECT_TRUE(NeighborsInTime(session, SubmapId(2), KeyframeId(15), {}).empty());
}

TEST(NeighborsInTime, JoinSubmapsThatRetrievalDoesNotSee) {
  const SyntheticFlight flight = InterruptedTwice();
  SilentBow bow;
  Recorder out;
  Merger merger({}, &bow, &out);
  for (const Record& r : flight.records()) ASSERT_EQ(merger.Consume(r), "");
  ASSERT_FALSE(out.transforms.empty());
  EXPECT_EQ(out.transforms.back().edges, (std::vector<std::pair<int, int>>{{0, 2}}));  // in flight already
  merger.Finalize();
  EXPECT_EQ(out.revision.edges, (std::vector<std::pair<int, int>>{{0, 2}}));
  EXPECT_EQ(out.revision.submaps[2].component, 0);
  EXPECT_EQ(out.revision.submaps[1].component, 1);
}

}  // namespace neighbors_in_time_test
}  // namespace mapmend
