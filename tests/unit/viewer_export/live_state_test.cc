#include "procs/viewer_export/live_state.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/test_flight.h"

namespace mapmend {
namespace {

using ::testing::HasSubstr;

nlohmann::json State(const MapModel& model, const LiveInputs& inputs = {}) {
  return nlohmann::json::parse(MakeLiveState(model, inputs, nullptr, false));
}

TEST(LiveStateTest, FollowsAFlightFromStartToEnd) {
  const TestFlight flight;
  MapModel model;
  EXPECT_EQ(State(model)["state"], "waiting");
  LiveInputs inputs;
  FramePose pose;
  pose.submap = flight.Key(0);
  pose.frame = 5;
  pose.state = "tracking";
  pose.num_inliers = 99;
  inputs.OnFramePose(pose);
  for (size_t i = 0; i < flight.Records().size() / 3; ++i) ASSERT_EQ(model.Apply(flight.Records()[i]), "");
  nlohmann::json state = State(model, inputs);
  EXPECT_EQ(state["state"], "tracking");
  EXPECT_EQ(state["headline"], "Tracking · frame 5");
  ASSERT_EQ(state["pictures"].size(), 1u);
  EXPECT_THAT(state["pictures"][0].get<std::string>(), HasSubstr("r=\"5.5\"")) << "the mark of the camera";
  pose.state = "lost";
  pose.submap.submap = SubmapId();
  inputs.OnFramePose(pose);
  EXPECT_EQ(State(model, inputs)["state"], "lost");
  model = MakeModel(flight);
  EXPECT_EQ(State(model, inputs)["state"], "merging");
  MapRevision revision = flight.Revision();
  model.SetRevision(revision);
  state = State(model, inputs);
  EXPECT_EQ(state["state"], "whole");
  EXPECT_EQ(state["figures"][0]["value"], "40");
  EXPECT_THAT(state["graph"].get<std::string>(), HasSubstr("Submap 1"));
  ASSERT_EQ(state["restoration"].size(), 3u);
  EXPECT_EQ(state["restoration"][1]["L1"], "A");
  EXPECT_EQ(state["restoration"][2]["L2"], "B-A");
  revision.transforms.submaps[1].component = 1;
  revision.transforms.revision++;
  model.SetRevision(revision);
  state = State(model, inputs);
  EXPECT_EQ(state["state"], "parts");
  EXPECT_EQ(state["pictures"].size(), 2u);
}

TEST(LiveStateTest, ShowsTheHealthOfEveryProcess) {
  LiveInputs inputs;
  Health health;
  health.process = "merger";
  health.state = "busy";
  health.message = "refining";
  health.counters["connections"] = 3;
  inputs.OnHealth(health);
  const nlohmann::json process = State(MapModel(), inputs)["processes"][0];
  EXPECT_EQ(process["name"], "merger");
  EXPECT_EQ(process["message"], "refining");
  EXPECT_EQ(process["note"], "connections 3");
  EXPECT_LT(process["age_s"].get<double>(), 5);
}

TEST(MapModelTest, TransformsAheadOfTheirRevisionKeepTheConnections) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  MergedTransforms ahead;
  ahead.revision = 4;
  ahead.submaps = flight.Revision().transforms.submaps;
  EXPECT_TRUE(model.SetTransforms(ahead));
  ASSERT_EQ(model.Revision().connections.size(), 1u);
  EXPECT_FALSE(model.Revision().connections[0].in_tree) << "these transforms have no tree edge";
  ahead.edges = {{1, 0}};
  EXPECT_FALSE(model.SetTransforms(ahead)) << "not newer";
  ahead.revision = 5;
  EXPECT_TRUE(model.SetTransforms(ahead));
  EXPECT_TRUE(model.Revision().connections[0].in_tree);
}

TEST(MapModelTest, IsCompleteOnceEveryRecordOfTheFinalRevisionIsKnown) {
  const TestFlight flight;
  MapRevision revision = flight.Revision();
  const int64_t last = static_cast<int64_t>(flight.Records().size()) - 1;
  revision.transforms.cursors = {{flight.Key(0).session, last}};
  MapModel model;
  for (int64_t i = 0; i < last; ++i) ASSERT_EQ(model.Apply(flight.Records()[i]), "");
  model.SetRevision(revision);
  EXPECT_FALSE(model.IsComplete()) << "the session's end is missing";
  ASSERT_EQ(model.Apply(flight.Records()[last]), "");
  EXPECT_TRUE(model.IsComplete());
  revision.transforms.is_final = false;
  model.SetRevision(revision);
  EXPECT_FALSE(model.IsComplete());
}

}  // namespace
}  // namespace mapmend
