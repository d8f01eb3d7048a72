#include "libs/merging/merger.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/merger_fixture.h"
#include "tests/synthetic_flight.h"

namespace mapmend {
namespace merger_test {

using testing::BruteForceBow;
using testing::CopyPatch;
using testing::Digest;
using testing::FlightOptions;
using testing::Frame;
using testing::MakeTerrain;
using testing::MergedError;
using testing::NadirPose;
using testing::Recorder;
using testing::Strip;
using testing::SyntheticFlight;
using testing::Terrain;
using testing::TerrainPoint;
using testing::ThreeCrossingStrips;

TEST(Merger, JoinsCrossingSubmapsIntoOneRefinedMap) {
  const SyntheticFlight flight = ThreeCrossingStrips();
  BruteForceBow bow(flight.records());
  Recorder out;
  Merger merger({}, &bow, &out);
  for (const Record& r : flight.records()) ASSERT_EQ(merger.Consume(r), "");
  // Joined live already, before the end.
  ASSERT_FALSE(out.transforms.empty());
  EXPECT_EQ(out.transforms.back().edges.size(), 2u);
  EXPECT_FALSE(out.transforms.back().is_final);

  ASSERT_TRUE(merger.AllEnded());
  merger.Finalize();
  EXPECT_TRUE(out.revision.is_final);
  EXPECT_TRUE(out.revision.refined);
  ASSERT_EQ(out.revision.submaps.size(), 3u);
  for (const auto& place : out.revision.submaps) EXPECT_EQ(place.component, 0);
  EXPECT_TRUE(out.revision.submaps[0].is_root);
  EXPECT_LT(MergedError(out, flight.world_from_keyframe()), 0.25);
  // Submaps 0 and 2 do not share ground: no edge between them, and none of the true ones has a wrong scale.
  for (const Connection& c : out.final_connections) {
    const int a = c.a.submap.value, b = c.b.submap.value;
    if (c.verdict != Connection::Verdict::kAccepted) continue;
    EXPECT_FALSE(a == 0 && b == 2);
    const Similarity3 truth = flight.submap_from_world()[b] * flight.submap_from_world()[a].Inverse();
    EXPECT_NEAR(c.b_from_a.scale / truth.scale, 1, 0.02);
    EXPECT_GT(c.num_common_points, 20);
    EXPECT_GT(c.strength, 5);
  }
  // Every part lists its keyframes, and duplicates were fused.
  size_t fused = 0;
  for (const RefinedSubmap& s : out.submaps) {
    EXPECT_FALSE(s.keyframes.empty());
    fused += s.fused.size();
  }
  EXPECT_GT(fused, 100u) << out.progress.back();
}

TEST(Merger, TransformsPublishedBeforeStayPutWhenASubmapJoins) {
  const SyntheticFlight flight = ThreeCrossingStrips();
  BruteForceBow bow(flight.records());
  Recorder out;
  Merger merger({}, &bow, &out);
  for (const Record& r : flight.records()) merger.Consume(r);
  for (const MergedTransforms& t : out.transforms) {
    EXPECT_EQ(ToArray(t.submaps[0].root_from_submap), ToArray(Similarity3()));
  }
  int64_t last = -1;
  for (const MergedTransforms& t : out.transforms) {
    EXPECT_GT(t.revision, last);
    last = t.revision;
  }
}

TEST(Merger, UnrelatedFlightsStayApartWithAReason) {
  std::mt19937_64 random(51);
  SyntheticFlight flight("s", 0, Terrain(), {});
  flight.AddSubmap(Strip({70, 70}, {150, 70}, 100, 5, 90, &random), Frame(0.02, 0.3));
  flight.AddSubmap(Strip({250, 320}, {330, 320}, 100, 5, 90, &random), Frame(0.03, 0.1));
  flight.End();
  BruteForceBow bow(flight.records());
  Recorder out;
  Merger merger({}, &bow, &out);
  for (const Record& r : flight.records()) merger.Consume(r);
  merger.Finalize();
  EXPECT_TRUE(out.revision.edges.empty());
  EXPECT_NE(out.revision.submaps[0].component, out.revision.submaps[1].component);
  for (const Connection& c : out.final_connections) {
    EXPECT_EQ(c.verdict, Connection::Verdict::kRejected);
    EXPECT_NE(c.reason.find("needed"), std::string::npos) << c.reason;
  }
}

TEST(Merger, PerceptualAliasingIsCaughtAsSoonAsTheGraphClosesACycle) {
  // The texture around (80, 80) lies a second time around (310, 310): submaps 0 and 2 look as if they met there.
  std::vector<TerrainPoint> terrain = MakeTerrain({});
  CopyPatch({20, 20}, {250, 250}, 120, &terrain);
  std::mt19937_64 random(61);
  SyntheticFlight flight("s", 0, terrain, {});
  flight.AddSubmap(Strip({80, 80}, {80, 200}, 100, 8, 0, &random), Frame(0.02, 0.3));
  flight.AddSubmap(Strip({60, 170}, {310, 170}, 100, 14, 90, &random), Frame(0.05, -0.9));
  flight.AddSubmap(Strip({310, 150}, {310, 320}, 100, 11, 0, &random), Frame(0.01, 2.0));
  flight.End();
  BruteForceBow bow(flight.records());
  Recorder out;
  Merger merger({}, &bow, &out);
  for (const Record& r : flight.records()) ASSERT_EQ(merger.Consume(r), "");
  // At once: its first evidence closes the cycle 0 - 1 - 2, and already with that it is told to be wrong. It is never
  // used.
  const auto first = std::find_if(out.connections.begin(), out.connections.end(), [](const Connection& c) {
    return c.a.submap == SubmapId(0) && c.b.submap == SubmapId(2) && c.num_connected_frames > 0;
  });
  ASSERT_NE(first, out.connections.end());
  EXPECT_EQ(first->verdict, Connection::Verdict::kDeactivated) << first->reason;
  for (const MergedTransforms& t : out.transforms) {
    for (const auto& edge : t.edges) EXPECT_NE(edge, std::pair(0, 2));
  }
  merger.Finalize();
  ASSERT_EQ(out.revision.edges.size(), 2u);
  bool caught = false;
  for (const Connection& c : out.final_connections) {
    if (c.a == c.b) continue;  // what was looked at within a submap
    const bool aliased = c.a.submap == SubmapId(0) && c.b.submap == SubmapId(2);
    if (aliased) {
      EXPECT_EQ(c.verdict, Connection::Verdict::kDeactivated) << c.reason;
      EXPECT_NE(c.reason.find("cycle"), std::string::npos) << c.reason;
      EXPECT_GT(c.num_connected_frames, 0);
      caught = true;
    } else {
      EXPECT_EQ(c.verdict, Connection::Verdict::kAccepted) << c.reason;
    }
  }
  EXPECT_TRUE(caught);
  EXPECT_LT(MergedError(out, flight.world_from_keyframe()), 0.4);
}

TEST(Merger, AConnectionIsEstimatedAnewFromAllItsEvidenceAsItsSubmapsGrow) {
  const SyntheticFlight flight = ThreeCrossingStrips();
  BruteForceBow bow(flight.records());
  Recorder out;
  Merger merger({}, &bow, &out);
  for (const Record& r : flight.records()) merger.Consume(r);
  const size_t live = out.connections.size();
  merger.Finalize();
  // What was said of the pair 0, 1 in the course of time: ever more connected frames and common points, an ever better
  // scale.
  std::vector<Connection> said;
  for (size_t i = 0; i < live; ++i) {
    const Connection& c = out.connections[i];
    if (c.a.submap == SubmapId(0) && c.b.submap == SubmapId(1) && c.num_connected_frames > 0) said.push_back(c);
  }
  ASSERT_GE(said.size(), 3u);
  for (size_t i = 1; i < said.size(); ++i) {
    EXPECT_GE(said[i].num_connected_frames, said[i - 1].num_connected_frames);
    EXPECT_GE(said[i].num_common_points, said[i - 1].num_common_points);
  }
  EXPECT_GT(said.back().num_connected_frames, said.front().num_connected_frames);
  EXPECT_GT(said.back().strength, said.front().strength);
  EXPECT_NE(ToArray(said.back().b_from_a), ToArray(said.front().b_from_a));
  const Similarity3 truth = flight.submap_from_world()[1] * flight.submap_from_world()[0].Inverse();
  EXPECT_NEAR(said.back().b_from_a.scale / truth.scale, 1, 0.01);
  // And the second pass, in which the older submap asks as well, knows at least as much.
  for (const Connection& c : out.final_connections) {
    if (c.a.submap == SubmapId(0) && c.b.submap == SubmapId(1)) {
      EXPECT_GE(c.num_common_points, said.back().num_common_points);
    }
  }
}

TEST(Merger, AConnectionIsAnnouncedWithTheMapUpdateThatBringsItsPoints) {
  const SyntheticFlight flight = ThreeCrossingStrips();
  BruteForceBow bow(flight.records());
  Recorder out;
  Merger merger({}, &bow, &out);
  int late = 0, in_time = 0;
  const Record* before = nullptr;
  for (const Record& r : flight.records()) {
    const size_t known = out.transforms.size();
    merger.Consume(r);
    if (out.transforms.size() > known) {
      // Right after the keyframe's own update, or at the end of a submap; never only when the next keyframe comes.
      const bool own_update =
          std::holds_alternative<MapUpdate>(r.body) && before && std::holds_alternative<KeyframeRecord>(before->body);
      ++(own_update || std::holds_alternative<SubmapEnded>(r.body) ? in_time : late);
    }
    before = &r;
  }
  EXPECT_GT(in_time, 3);
  EXPECT_EQ(late, 0);
}

TEST(Merger, ALoopWithinASubmapIsClosedAndTold) {
  std::mt19937_64 random(71);
  std::vector<Rigid3> circle;
  for (int i = 0; i < 42; ++i) {
    const double phi = 2 * M_PI * i / 36;
    circle.push_back(
        NadirPose(200 + 70 * std::sin(phi), 200 + 70 * std::cos(phi), 100, 90 + phi * 180 / M_PI, &random));
  }
  FlightOptions options;
  options.max_features = 400;
  options.scale_drift = 0.004;
  SyntheticFlight flight("s", 0, Terrain(), options);
  flight.AddSubmap(circle, Frame(0.02, 0.3));
  flight.End();
  std::vector<Recorder> outs(2);
  for (Recorder& out : outs) {
    BruteForceBow bow(flight.records());
    Merger merger({}, &bow, &out);
    for (const Record& r : flight.records()) ASSERT_EQ(merger.Consume(r), "");
    merger.Finalize();
  }
  const Recorder& out = outs[0];
  EXPECT_LT(MergedError(out, flight.world_from_keyframe()), 0.15);
  EXPECT_TRUE(out.revision.edges.empty());
  ASSERT_EQ(out.final_connections.size(), 1u);
  const Connection& loops = out.final_connections[0];
  EXPECT_EQ(loops.a, loops.b);
  EXPECT_EQ(loops.verdict, Connection::Verdict::kAccepted) << loops.reason;
  EXPECT_FALSE(loops.in_tree);
  EXPECT_GE(loops.num_connected_frames, 2);
  EXPECT_GT(loops.num_common_points, 50);
  EXPECT_GT(loops.strength, 5);
  EXPECT_FALSE(out.connections.empty());  // announced
  // The older end has not drifted yet; at the younger one the map has grown by about 0.4 % a keyframe.
  EXPECT_NEAR(loops.b_from_a.scale, std::pow(1.004, 36), 0.02);
  EXPECT_EQ(Digest(outs[1]), Digest(out));
}

TEST(Merger, AnEdgeSwitchedOffByHandStaysOff) {
  const SyntheticFlight flight = ThreeCrossingStrips();
  BruteForceBow bow(flight.records());
  Recorder out;
  Merger merger({}, &bow, &out);
  for (const Record& r : flight.records()) merger.Consume(r);
  const std::string session = flight.records()[0].header.session;
  merger.SetDecisions({{{session, SubmapId(1)}, {session, SubmapId(0)}, true}});
  EXPECT_EQ(out.transforms.back().edges.size(), 1u);
  merger.Finalize();
  EXPECT_EQ(out.revision.edges.size(), 1u);
  EXPECT_NE(out.revision.submaps[0].component, out.revision.submaps[1].component);
  merger.SetDecisions({{{session, SubmapId(1)}, {session, SubmapId(0)}, true},
                       {{session, SubmapId(0)}, {session, SubmapId(1)}, false}});
  EXPECT_EQ(out.transforms.back().edges.size(), 2u);
}

}  // namespace merger_test
}  // namespace mapmend
