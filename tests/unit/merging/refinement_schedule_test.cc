#include "libs/merging/refinement_schedule.h"

#include <gtest/gtest.h>

#include "tests/synthetic_flight.h"

namespace mapmend {
namespace refinement_schedule_test {

using testing::MakeTerrain;
using testing::Strip;
using testing::SyntheticFlight;
using testing::TerrainPoint;

const SubmapKey kFirst{"s", SubmapId(0)}, kSecond{"s", SubmapId(1)}, kThird{"s", SubmapId(2)};
const SubmapPair kPair{kFirst, kSecond};

// Submaps 0 and 1 overlap; 2 lies apart and holds more frames than both.
class RefinementScheduleTest : public ::testing::Test {
 protected:
  RefinementScheduleTest() {
    std::mt19937_64 random(9);
    static const std::vector<TerrainPoint> terrain = MakeTerrain({});
    SyntheticFlight flight("s", 0, terrain, {});
    flight.AddSubmap(Strip({80, 80}, {180, 80}, 100, 5, 90, &random), Similarity3());
    flight.AddSubmap(Strip({80, 100}, {180, 100}, 100, 5, 90, &random), Similarity3());
    flight.AddSubmap(Strip({80, 320}, {320, 320}, 100, 14, 90, &random), Similarity3());
    flight.End();
    sessions_.emplace("s", flight.Model());
  }
  void Connect() {
    const SubmapView a = ViewSubmap(sessions_, kFirst), b = ViewSubmap(sessions_, kSecond);
    for (const auto& [ka, keyframe_a] : a.submap->keyframes) {
      for (const auto& [kb, keyframe_b] : b.submap->keyframes)
        graph_.Add(kPair, VerifyConnectedFrames(a, ka, b, kb, {}));
    }
    graph_.Solve(sessions_, {}, false);
    ASSERT_TRUE(graph_.IsAccepted(kPair));
  }
  RefinementTask Begin() {
    return schedule_.Begin(sessions_, graph_, PlaceSubmaps(sessions_, graph_, schedule_.places()), false, false);
  }
  // The outcome of a refinement that moved submap 1.
  RefinementOutcome Moved(const RefinementTask& task) {
    RefinementOutcome outcome;
    outcome.transforms = task.transforms;
    outcome.transforms.submaps.at(1).root_from_submap.scale *= 3;
    return outcome;
  }
  // Keyframes beside those that are there, as a submap that grows has them.
  void Grow(SubmapId submap, int num_keyframes) {
    auto& keyframes = sessions_.at("s").submaps.at(submap).keyframes;
    const SubmapKeyframe last = keyframes.rbegin()->second;
    for (int i = 0; i < num_keyframes; ++i) keyframes[KeyframeId(1000 + i)] = last;
  }

  Sessions sessions_;
  ConnectionGraph graph_{{}};
  RefinementSchedule schedule_{{}};
};

TEST_F(RefinementScheduleTest, IsDueWhenSubmapsAreJoinedAndWhenTheMapHasGrownByHalf) {
  graph_.Solve(sessions_, {}, false);
  EXPECT_FALSE(schedule_.IsDue(sessions_, graph_));
  Connect();
  EXPECT_TRUE(schedule_.IsDue(sessions_, graph_));
  Begin();
  EXPECT_FALSE(schedule_.IsDue(sessions_, graph_));
  Grow(SubmapId(1), 4);
  EXPECT_FALSE(schedule_.IsDue(sessions_, graph_));  // 14 of 10
  Grow(SubmapId(1), 5);
  EXPECT_TRUE(schedule_.IsDue(sessions_, graph_));  // 15 of 10
}

TEST_F(RefinementScheduleTest, SubmapsStayWhereTheyWereRefinedTo) {
  Connect();
  const RefinementTask task = Begin();
  ASSERT_TRUE(schedule_.Take(Moved(task), graph_));
  const MergedTransforms before = task.transforms;
  const MergedTransforms after = PlaceSubmaps(sessions_, graph_, schedule_.places());
  const auto scale = [](const MergedTransforms& t) {
    return t.submaps[1].root_from_submap.scale / t.submaps[0].root_from_submap.scale;
  };
  EXPECT_NEAR(scale(after) / scale(before), 3, 1e-9);
}

TEST_F(RefinementScheduleTest, WhatWasRefinedWithAConnectionThatProvedWrongIsForgotten) {
  Connect();
  ASSERT_TRUE(schedule_.Take(Moved(Begin()), graph_));
  schedule_.OnGraphChange(graph_);
  EXPECT_FALSE(schedule_.places().empty());
  graph_.SetDecisions({{kFirst, kSecond, true}});
  graph_.Solve(sessions_, {}, false);
  schedule_.OnGraphChange(graph_);
  EXPECT_TRUE(schedule_.places().empty());
}

TEST_F(RefinementScheduleTest, AnOutcomeOfConnectionsThatHoldNoMoreIsRefused) {
  Connect();
  const RefinementTask task = Begin();
  graph_.SetDecisions({{kFirst, kSecond, true}});
  graph_.Solve(sessions_, {}, false);
  EXPECT_FALSE(schedule_.Take(Moved(task), graph_));
  EXPECT_TRUE(schedule_.places().empty());
}

TEST_F(RefinementScheduleTest, ATaskHoldsTheEvidenceThatAgreesAndIsStillThere) {
  Connect();
  const size_t num_links = Begin().links.size();
  EXPECT_EQ(num_links, static_cast<size_t>(graph_.connections().at(kPair).num_connected_frames));
  const KeyframeId culled = graph_.connections().at(kPair).evidence.front().keyframe_b;
  sessions_.at("s").submaps.at(SubmapId(1)).keyframes.erase(culled);
  const RefinementTask task = Begin();
  EXPECT_LT(task.links.size(), num_links);
  for (const RefinementLink& link : task.links) {
    EXPECT_NE(link.keyframe_b, culled);
    EXPECT_GT(link.sigmas.scale, 0) << "each piece of evidence says what it leaves open";
  }
}

TEST_F(RefinementScheduleTest, ComponentsAreNumberedByTheFramesTheyHold) {
  Connect();
  const MergedTransforms places = PlaceSubmaps(sessions_, graph_, {});
  ASSERT_EQ(places.submaps.size(), 3u);
  EXPECT_EQ(places.submaps[2].component, 0);  // 14 frames to 10
  EXPECT_EQ(places.submaps[0].component, 1);
  EXPECT_EQ(places.submaps[1].component, 1);
  EXPECT_TRUE(places.submaps[0].is_root);
  EXPECT_FALSE(places.submaps[1].is_root);
}

}  // namespace refinement_schedule_test
}  // namespace mapmend
