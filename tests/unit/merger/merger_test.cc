#include "procs/merger/merger.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "libs/geometry/sim3_closed_form.h"
#include "tests/unit/merger/synthetic_flight.h"

namespace mapmend {
namespace {

using testing::CopyPatch;
using testing::FlightOptions;
using testing::MakeTerrain;
using testing::NadirPose;
using testing::Strip;
using testing::SyntheticFlight;
using testing::TerrainPoint;

const std::vector<TerrainPoint>& Terrain() {
  static const std::vector<TerrainPoint> terrain = MakeTerrain({});
  return terrain;
}

// Retrieval by brute force over all records up to the cursors.
class BruteForceBow : public BowSource {
 public:
  explicit BruteForceBow(std::vector<Record> records) : records_(std::move(records)) {}

  std::vector<BowProposal> Query(const BowQuestion& question) override {
    const KeyframeRecord* query = nullptr;
    for (const Record& r : records_) {
      const auto* k = std::get_if<KeyframeRecord>(&r.body);
      if (k && r.header.session == question.session && k->keyframe == question.keyframe) query = k;
    }
    std::vector<BowProposal> proposals;
    for (const Record& r : records_) {
      const auto* k = std::get_if<KeyframeRecord>(&r.body);
      if (!k) continue;
      const auto cursor = std::find_if(question.cursors.begin(), question.cursors.end(),
                                       [&](const MergerCursor& c) { return c.session == r.header.session; });
      if (cursor == question.cursors.end() || r.header.seq > cursor->seq) continue;
      const bool same = r.header.session == question.session && k->submap == query->submap;
      if (same && (!question.same_submap || std::abs(k->keyframe.value - question.keyframe.value) < 6)) continue;
      const double score = BowScore(query->bow, k->bow);
      if (score > 0.05) proposals.push_back({r.header.session, k->submap, k->keyframe, score});
    }
    std::stable_sort(proposals.begin(), proposals.end(),
                     [](const BowProposal& l, const BowProposal& r) { return l.group_score > r.group_score; });
    if (static_cast<int>(proposals.size()) > question.max_results) proposals.resize(question.max_results);
    ++num_queries_;
    return proposals;
  }
  int num_queries() const { return num_queries_; }

 private:
  std::vector<Record> records_;
  int num_queries_ = 0;
};

struct Recorder : MergerOutput {
  void OnConnection(const Connection& c) override { connections.push_back(c); }
  void OnTransforms(const MergedTransforms& t) override { transforms.push_back(t); }
  void OnRevision(const MergedTransforms& t, const std::vector<Connection>& c,
                  const std::vector<RefinedSubmap>& s) override {
    revision = t;
    final_connections = c;
    submaps = s;
  }
  void OnProgress(const std::string& what) override { progress.push_back(what); }

  std::vector<Connection> connections, final_connections;
  std::vector<MergedTransforms> transforms;
  MergedTransforms revision;
  std::vector<std::string> progress;
  std::vector<RefinedSubmap> submaps;
};

Similarity3 Frame(double scale, double angle) {
  return {scale, Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, -1).normalized())),
          Eigen::Vector3d(3, -2, 7)};
}

// Three submaps: 0 and 1 cross at 90 degrees, 2 lies apart from 0 and crosses 1.
SyntheticFlight ThreeCrossingStrips() {
  std::mt19937_64 random(31);
  SyntheticFlight flight("11111111-0000-0000-0000-000000000000", 1000, Terrain(), {});
  flight.AddSubmap(Strip({100, 100}, {240, 100}, 100, 8, 90, &random), Frame(0.02, 0.3));
  flight.AddSubmap(Strip({170, 80}, {170, 320}, 100, 12, 0, &random), Frame(0.05, -0.9));
  flight.AddSubmap(Strip({240, 290}, {100, 290}, 100, 8, 270, &random), Frame(0.01, 2.0));
  flight.End();
  return flight;
}

double MergedError(const Recorder& out, const std::vector<Rigid3>& world_from_keyframe) {
  std::vector<Eigen::Vector3d> estimated, truth;
  for (const RefinedSubmap& s : out.submaps) {
    for (const RefinedSubmap::Keyframe& k : s.keyframes) {
      estimated.push_back(k.cam_from_root.Center());
      truth.push_back(world_from_keyframe[k.id.value].translation);
    }
  }
  const Similarity3 t = *HornAlignment(estimated, truth);
  double sum = 0;
  for (size_t i = 0; i < truth.size(); ++i) sum += (t * estimated[i] - truth[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

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

TEST(Merger, IsAPureFunctionOfTheStream) {
  const SyntheticFlight flight = ThreeCrossingStrips();
  Recorder first, second;
  for (Recorder* out : {&first, &second}) {
    BruteForceBow bow(flight.records());
    Merger merger({}, &bow, out);
    for (const Record& r : flight.records()) merger.Consume(r);
    merger.Finalize();
  }
  ASSERT_EQ(first.submaps.size(), second.submaps.size());
  for (size_t s = 0; s < first.submaps.size(); ++s) {
    ASSERT_EQ(first.submaps[s].points.size(), second.submaps[s].points.size());
    for (size_t i = 0; i < first.submaps[s].points.size(); ++i) {
      EXPECT_EQ(first.submaps[s].points[i].position, second.submaps[s].points[i].position);
    }
    for (size_t i = 0; i < first.submaps[s].keyframes.size(); ++i) {
      EXPECT_EQ(ToArray(first.submaps[s].keyframes[i].cam_from_root), ToArray(second.submaps[s].keyframes[i].cam_from_root));
    }
  }
}

TEST(Merger, TwoSessionsJoinWhateverTheOrderOfArrival) {
  std::mt19937_64 random(41);
  SyntheticFlight first("aaaa", 5000, Terrain(), {});
  first.AddSubmap(Strip({100, 100}, {240, 100}, 100, 7, 90, &random), Frame(0.02, 0.3));
  first.End();
  FlightOptions other_camera;
  other_camera.camera = {420, 425, 300, 260, 600, 500};
  other_camera.seed = 77;
  SyntheticFlight second("bbbb", 1000, Terrain(), other_camera);  // began earlier
  second.AddSubmap(Strip({170, 60}, {170, 180}, 110, 7, 0, &random), Frame(0.05, -0.9));
  second.End();
  std::vector<Record> all = first.records();
  all.insert(all.end(), second.records().begin(), second.records().end());

  std::vector<Recorder> outs(2);
  for (int order = 0; order < 2; ++order) {
    BruteForceBow bow(all);
    Merger merger({}, &bow, &outs[order]);
    for (const Record& r : (order ? second : first).records()) ASSERT_EQ(merger.Consume(r), "");
    for (const Record& r : (order ? first : second).records()) ASSERT_EQ(merger.Consume(r), "");
    merger.Finalize();
    ASSERT_EQ(outs[order].revision.edges.size(), 1u);
    EXPECT_EQ(outs[order].revision.submaps[0].key.session, "bbbb");  // the older one is the root
  }
  EXPECT_EQ(ToArray(outs[0].revision.submaps[1].root_from_submap), ToArray(outs[1].revision.submaps[1].root_from_submap));
  EXPECT_EQ(outs[0].revision.revision, outs[1].revision.revision);
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
  // At once: its first evidence closes the cycle 0 - 1 - 2, and already with that it is told to be wrong. It is never used.
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

// All that a revision says, as text.
std::string Digest(const Recorder& out) {
  std::string text;
  const auto add = [&](const auto& values) {
    for (const double v : values) text += std::to_string(v) + " ";
  };
  for (const auto& place : out.revision.submaps) {
    text += std::to_string(place.component) + ":";
    add(ToArray(place.root_from_submap));
  }
  for (const Connection& c : out.final_connections) text += c.reason + (c.in_tree ? " tree\n" : "\n");
  for (const RefinedSubmap& s : out.submaps) {
    for (const auto& k : s.keyframes) add(ToArray(k.cam_from_root));
    for (const auto& p : s.points) add(std::vector<float>{p.position.x(), p.position.y(), p.position.z()});
    text += std::to_string(s.fused.size()) + "\n";
  }
  return text;
}

TEST(Merger, RefinementDuringTheFlightComesAsARevisionAndDoesNotTouchTheFinalMap) {
  const SyntheticFlight flight = ThreeCrossingStrips();
  Recorder plain;
  {
    BruteForceBow bow(flight.records());
    Merger merger({}, &bow, &plain);
    for (const Record& r : flight.records()) ASSERT_EQ(merger.Consume(r), "");
    merger.Finalize();
  }
  Recorder out;
  BruteForceBow bow(flight.records());
  Merger merger({}, &bow, &out);
  int num_taken = 0;
  std::optional<RefinementOutcome> late;  // arrives some records after it was asked for, as from a thread
  int64_t last = -1;
  for (const Record& r : flight.records()) {
    ASSERT_EQ(merger.Consume(r), "");
    if (late && merger.TakeRefinement(*late)) {
      ++num_taken;
      EXPECT_TRUE(out.revision.refined);
      EXPECT_FALSE(out.revision.is_final);
      EXPECT_EQ(out.revision.revision % 2, 1);
      // Its places stand: the next record that changes no connection announces nothing.
      EXPECT_EQ(ToArray(merger.transforms().submaps[0].root_from_submap), ToArray(Similarity3()));
    }
    late.reset();
    if (merger.RefinementIsDue()) {
      late = RunRefinement(merger.MakeRefinement(), {});
      EXPECT_FALSE(merger.RefinementIsDue());
    }
    EXPECT_GE(merger.revision(), last);
    last = merger.revision();
  }
  EXPECT_GE(num_taken, 2);
  EXPECT_FALSE(merger.RefinementIsDue());  // all have ended: only the final one is left
  merger.Complete();
  ASSERT_TRUE(merger.RefinementIsDue());
  if (late) {
    EXPECT_FALSE(merger.TakeRefinement(*late));
  }
  ASSERT_TRUE(merger.TakeRefinement(RunRefinement(merger.MakeRefinement(), {})));
  EXPECT_FALSE(merger.RefinementIsDue());
  EXPECT_TRUE(out.revision.is_final);
  EXPECT_EQ(Digest(out), Digest(plain));
}

TEST(Merger, TheFinalMapIsAFunctionOfStreamAndDecisionsWheneverTheyWereMade) {
  const SyntheticFlight flight = ThreeCrossingStrips();
  const std::string session = flight.records()[0].header.session;
  const std::vector<EdgeDecision> decisions = {{{session, SubmapId(0)}, {session, SubmapId(1)}, true},
                                               {{session, SubmapId(1)}, {session, SubmapId(2)}, true},
                                               {{session, SubmapId(2)}, {session, SubmapId(1)}, false}};
  std::vector<Recorder> outs(3);
  for (int when = 0; when < 3; ++when) {
    BruteForceBow bow(flight.records());
    Merger merger({}, &bow, &outs[when]);
    if (when == 0) merger.SetDecisions(decisions);  // a merger that was started again
    size_t i = 0;
    for (const Record& r : flight.records()) {
      merger.Consume(r);
      if (when == 1 && ++i == flight.records().size() / 2) merger.SetDecisions({decisions[0]});
      if (when == 1 && i == flight.records().size() * 3 / 4) merger.SetDecisions(decisions);
    }
    merger.Finalize();
    if (when == 2) {  // after the end
      EXPECT_EQ(outs[when].revision.edges.size(), 2u);
      const int64_t before = outs[when].revision.revision;
      merger.SetDecisions(decisions);
      ASSERT_TRUE(merger.RefinementIsDue());
      ASSERT_TRUE(merger.TakeRefinement(RunRefinement(merger.MakeRefinement(), {})));
      EXPECT_GT(outs[when].revision.revision, before);
    }
    EXPECT_TRUE(outs[when].revision.is_final);
    EXPECT_EQ(outs[when].revision.edges.size(), 1u);
    EXPECT_EQ(outs[when].revision.revision, outs[0].revision.revision);
    EXPECT_EQ(Digest(outs[when]), Digest(outs[0]));
    for (const Connection& c : outs[when].final_connections) {
      if (c.a.submap == SubmapId(0) && c.b.submap == SubmapId(1)) {
        EXPECT_EQ(c.verdict, Connection::Verdict::kDeactivated);
        EXPECT_NE(c.reason.find("switched off by hand"), std::string::npos) << c.reason;
      }
    }
  }
}

TEST(Merger, AConnectionIsEstimatedAnewFromAllItsEvidenceAsItsSubmapsGrow) {
  const SyntheticFlight flight = ThreeCrossingStrips();
  BruteForceBow bow(flight.records());
  Recorder out;
  Merger merger({}, &bow, &out);
  for (const Record& r : flight.records()) merger.Consume(r);
  const size_t live = out.connections.size();
  merger.Finalize();
  // What was said of the pair 0, 1 in the course of time: ever more connected frames and common points, an ever better scale.
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

TEST(Merger, TheMapIsTheSameHoweverFewKeyframesAreHeld) {
  struct RecordSource : KeyframeSource {
    explicit RecordSource(const std::vector<Record>& all) : records(all) {}
    KeyframeRecord Read(const std::string&, int64_t seq) override { return std::get<KeyframeRecord>(records.at(seq).body); }
    const std::vector<Record>& records;
  };
  const SyntheticFlight flight = ThreeCrossingStrips();
  Recorder all, few;
  {
    BruteForceBow bow(flight.records());
    Merger merger({}, &bow, &all);
    for (const Record& r : flight.records()) ASSERT_EQ(merger.Consume(r), "");
    merger.Finalize();
    EXPECT_EQ(merger.keyframe_cache().num_loaded(), 28);
    EXPECT_EQ(merger.keyframe_cache().num_reads(), 0);
  }
  BruteForceBow bow(flight.records());
  RecordSource source(flight.records());
  MergerOptions options;
  options.max_cached_keyframes = 24;
  ASSERT_EQ(options.Check(), "");
  Merger merger(options, &bow, &few, &source);
  for (const Record& r : flight.records()) {
    ASSERT_EQ(merger.Consume(r), "");
    EXPECT_LE(merger.keyframe_cache().num_loaded(), 24);
  }
  merger.Finalize();
  EXPECT_GT(merger.keyframe_cache().num_reads(), 4);
  int complete = 0;
  for (const auto& [id, submap] : merger.sessions().begin()->second.submaps) {
    for (const auto& [k, keyframe] : submap.keyframes) complete += !keyframe.features.descriptors.empty();
  }
  EXPECT_EQ(complete, 24);
  EXPECT_EQ(Digest(few), Digest(all));
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
      const bool own_update = std::holds_alternative<MapUpdate>(r.body) && before &&
                              std::holds_alternative<KeyframeRecord>(before->body);
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
    circle.push_back(NadirPose(200 + 70 * std::sin(phi), 200 + 70 * std::cos(phi), 100, 90 + phi * 180 / M_PI, &random));
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

}  // namespace
}  // namespace mapmend
