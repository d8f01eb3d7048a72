#include "procs/viewer_export/live_state.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "procs/viewer_export/live_overview.h"
#include "tests/test_flight.h"

namespace mapmend {
namespace live_state_test {

using Json = nlohmann::json;

Json Values(const MapModel& model, const LiveInputs& inputs = {}, const LiveRun& run = {},
            const std::vector<EdgeDecision>& decisions = {}) {
  LiveFeed feed;
  PublishState(model, inputs, run, &feed);
  PublishParts(model, decisions, &feed);
  return Json::parse(feed.Values());
}

FramePose Pose(const TestFlight& flight, const std::string& state) {
  FramePose pose;
  pose.frame = 5;
  pose.state = state;
  pose.num_inliers = 99;
  if (state == "tracking") pose.submap = flight.Key(0);
  return pose;
}

TEST(LiveStateTest, FollowsAFlightFromStartToEnd) {
  const TestFlight flight;
  MapModel model;
  EXPECT_EQ(Values(model)["run"]["state"], "waiting");
  LiveInputs inputs;
  inputs.OnFramePose(Pose(flight, "tracking"));
  for (size_t i = 0; i < flight.Records().size() / 3; ++i) ASSERT_EQ(model.Apply(flight.Records()[i]), "");
  Json values = Values(model, inputs);
  EXPECT_EQ(values["run"]["state"], "tracking");
  EXPECT_EQ(values["pose"]["submap"], "0:0");
  EXPECT_EQ(values["submap/0:0"]["number"], 0);
  EXPECT_FALSE(values["submap/0:0"].contains("place")) << "the merger has not spoken";
  inputs.OnFramePose(Pose(flight, "lost"));
  values = Values(model, inputs);
  EXPECT_EQ(values["run"]["state"], "lost");
  EXPECT_FALSE(values["pose"].contains("submap"));
  model = MakeModel(flight);
  EXPECT_EQ(Values(model, inputs)["run"]["state"], "merging");
  EXPECT_FALSE(Values(model, inputs).contains("pose")) << "the flight has ended";
  LiveRun stored;
  stored.is_stored = true;
  EXPECT_EQ(Values(model, inputs, stored)["run"]["state"], "unmerged");
  MapRevision revision = flight.Revision();
  model.SetRevision(revision);
  values = Values(model, inputs);
  EXPECT_EQ(values["run"]["state"], "whole");
  EXPECT_EQ(values["submap/0:1"]["component"], 0);
  EXPECT_EQ(values["submap/0:1"]["place"].size(), 8u);
  EXPECT_TRUE(values["submap/0:0"]["lost"].get<bool>());
  revision.transforms.submaps[1].component = 1;
  revision.transforms.revision++;
  model.SetRevision(revision);
  EXPECT_EQ(Values(model, inputs)["run"]["state"], "parts");
}

TEST(LiveStateTest, EdgesCarryWhatThePaperCallsThem) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  MapRevision revision = flight.Revision();
  const EvaluatedConnection& connection = revision.connections.at(0);
  model.SetRevision(revision);
  const Json values = Values(model, {}, {}, {{connection.b, connection.a, true}});
  const Json edge = values["edge/0:0|0:1"];
  ASSERT_TRUE(edge.is_object());
  EXPECT_EQ(edge["F"], connection.num_connected_frames);
  EXPECT_EQ(edge["M"], connection.num_common_points);
  EXPECT_NEAR(edge["theta"].get<double>(), connection.median_angle_deg, 0.05);
  EXPECT_NEAR(edge["C"].get<double>(), connection.strength, 0.05);
  EXPECT_EQ(edge["reason"], connection.reason);
  EXPECT_TRUE(edge["tree"].get<bool>());
  EXPECT_TRUE(edge["disabled"].get<bool>()) << "a decision names its submaps in either order";
}

TEST(LiveStateTest, EveryVehicleHasItsFrontend) {
  LiveInputs inputs;
  Health health;
  health.process = "frontend";
  health.host = HostName();
  health.state = "busy";
  inputs.OnHealth(health);
  EXPECT_EQ(Values(MapModel(), inputs)["process/frontend"]["state"], "busy");
  for (const char* session : {"a", "b", "a"}) {
    health.cursors = {{session, 1}};
    ++health.pid;  // one is started again
    health.counters["fps"] = 12.3456;
    inputs.OnHealth(health);
  }
  const Json values = Values(MapModel(), inputs);
  EXPECT_FALSE(values.contains("process/frontend"));
  EXPECT_EQ(values["process/frontend/a"]["counters"]["fps"], 12.35);
  EXPECT_TRUE(values.contains("process/frontend/b"));
}

TEST(LiveStateTest, ProcessesOfOneNameOnSeveralHostsStandSideBySide) {
  LiveInputs inputs;
  Health health;
  health.process = "hub";
  health.host = HostName();
  inputs.OnHealth(health);
  health.host = "drone-1";
  health.rss_mb = 9;
  inputs.OnHealth(health);
  health.process = "frontend";  // has no session yet
  inputs.OnHealth(health);
  Json values = Values(MapModel(), inputs);
  EXPECT_EQ(values["process/hub"]["host"], HostName());
  EXPECT_EQ(values["process/hub@drone-1"]["host"], "drone-1");
  EXPECT_EQ(values["process/hub@drone-1"]["rss_mb"], 9);
  EXPECT_TRUE(values.contains("process/frontend@drone-1"));
  health.cursors = {{"a", 1}};
  inputs.OnHealth(health);
  values = Values(MapModel(), inputs);
  EXPECT_FALSE(values.contains("process/frontend@drone-1"));
  EXPECT_EQ(values["process/frontend/a"]["host"], "drone-1");
}

TEST(LiveStateTest, WhoeverHasNotReadAllIsBehind) {
  LiveInputs inputs;
  Health health;
  health.host = HostName();
  const auto tell = [&](const char* process, std::map<std::string, int64_t> cursors) {
    health.process = process;
    health.cursors = std::move(cursors);
    inputs.OnHealth(health);
  };
  tell("frontend", {{"a", 90}});
  tell("submap_store", {{"a", 80}, {"b", 7}});
  tell("merger", {{"a", 50}, {"b", 5}});
  const Json values = Values(MapModel(), inputs);
  EXPECT_EQ(values["process/frontend/a"]["behind"], 0);
  EXPECT_EQ(values["process/submap_store"]["behind"], 10);
  EXPECT_EQ(values["process/merger"]["behind"], 42);
}

TEST(LiveStateTest, SilenceCountsOnlyWhileSomebodyListens) {
  LiveInputs inputs;
  Health health;
  health.process = "merger";
  health.host = HostName();
  inputs.OnHealth(health);
  inputs.WasDeaf(-std::chrono::seconds(20));  // as if it had been heard long ago
  EXPECT_EQ(Values(MapModel(), inputs)["process/merger"]["silent_s"], 23);
  inputs.WasDeaf(std::chrono::seconds(20));
  EXPECT_EQ(Values(MapModel(), inputs)["process/merger"]["silent_s"], 0);
}

TEST(LiveOverviewTest, TellsFiguresRestorationFramesAndGaps) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  LiveFeed feed;
  LiveOverview overview({});
  overview.Publish(model, true, &feed);
  const Json values = Json::parse(feed.Values());
  EXPECT_EQ(values["figures"]["frames_tracked"], 40);
  EXPECT_EQ(values["figures"]["losses"], 1);
  EXPECT_EQ(values["figures"]["points_in_main"], ComponentPoints(MakeSnapshot(model), 0).size());
  ASSERT_EQ(values["restoration"].size(), 3u);
  EXPECT_EQ(values["restoration"][1]["L1"], "A");
  EXPECT_EQ(values["restoration"][1]["lost"], "0:0");
  EXPECT_EQ(values["restoration"][2]["L2"], "B-A");
  EXPECT_EQ(values["restoration"][2]["maps"], Json::parse("[[\"0:1\",\"0:0\"]]"));
  EXPECT_TRUE(values["gaps"]["ground"].get<bool>());
  EXPECT_EQ(overview.Stacks(), "L1 –; L2 B-A");
  // The camera looks straight down: upright, its z axis points down.
  const Json frame = values["frame/0:0"]["page_from_root"];
  const Similarity3 page_from_root = SimilarityFromArray(frame.get<std::vector<double>>().data());
  EXPECT_LT((page_from_root.rotation * Eigen::Vector3d::UnitZ()).z(), -0.99);
}

TEST(LiveOverviewTest, ALargeMapIsNotWorkedOutAtEveryLook) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  LiveFeed feed;
  OverviewOptions options;
  options.min_pause = std::chrono::hours(1);
  LiveOverview overview(options);
  overview.Publish(model, false, &feed);
  const int64_t before = feed.Version();
  model.SetRevision(flight.Revision());
  overview.Publish(model, false, &feed);
  EXPECT_EQ(feed.Version(), before);
  overview.Publish(model, true, &feed);
  EXPECT_GT(feed.Version(), before) << "but once it is final";
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

}  // namespace live_state_test
}  // namespace mapmend
