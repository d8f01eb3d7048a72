#include "libs/map_view/dead_reckoning.h"

#include <gtest/gtest.h>

#include "tests/test_flight.h"

namespace mapmend {
namespace dead_reckoning_test {

TEST(DeadReckoning, SubmapsThatNothingJoinsHaveALikelyPlace) {
  TestFlightOptions options;
  options.frames_per_submap = 10;  // all on one strip
  const TestFlight flight(options);
  const MapModel model = MakeModel(flight);
  const Snapshot snapshot = MakeSnapshot(model);
  const std::vector<LikelyPlace> places = FindLikelyPlaces(snapshot);
  ASSERT_EQ(places.size(), 1u);
  EXPECT_EQ(places[0].earlier, 0);
  EXPECT_EQ(places[0].later, 1);
  EXPECT_EQ(places[0].last_frame, 9);
  EXPECT_EQ(places[0].first_frame, flight.FirstFrame(1));
  const std::string text = DescribeLikelyPlace(places[0], snapshot);
  EXPECT_NE(text.find("frame 15 was"), std::string::npos) << text;
  EXPECT_NE(text.find("map units from frame 9"), std::string::npos) << text;
  const Similarity3 truth = flight.WorldFromSubmap(0).Inverse() * flight.WorldFromSubmap(1);
  EXPECT_NEAR(places[0].earlier_from_later.scale / truth.scale, 1, 0.02);
  EXPECT_LT((places[0].earlier_from_later.translation - truth.translation).norm(), 0.2) << "two metres";
}

TEST(DeadReckoning, WhatIsJoinedNeedsNone) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  EXPECT_TRUE(FindLikelyPlaces(MakeSnapshot(model)).empty());
}

}  // namespace dead_reckoning_test
}  // namespace mapmend
