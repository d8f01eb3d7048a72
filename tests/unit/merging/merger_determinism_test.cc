#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <optional>

#include "libs/merging/flight_seed.h"
#include "libs/merging/merger.h"
#include "tests/merger_fixture.h"
#include "tests/synthetic_flight.h"

namespace mapmend {
namespace merger_determinism_test {

using testing::BruteForceBow;
using testing::Digest;
using testing::FlightOptions;
using testing::Frame;
using testing::Recorder;
using testing::Strip;
using testing::SyntheticFlight;
using testing::Terrain;
using testing::ThreeCrossingStrips;

TEST(MergerDeterminism, IsAPureFunctionOfTheStream) {
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
      EXPECT_EQ(ToArray(first.submaps[s].keyframes[i].cam_from_root),
                ToArray(second.submaps[s].keyframes[i].cam_from_root));
    }
  }
}

TEST(MergerDeterminism, TwoSessionsJoinWhateverTheOrderOfArrival) {
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
  EXPECT_EQ(ToArray(outs[0].revision.submaps[1].root_from_submap),
            ToArray(outs[1].revision.submaps[1].root_from_submap));
  EXPECT_EQ(outs[0].revision.revision, outs[1].revision.revision);
}

TEST(MergerDeterminism, RefinementDuringTheFlightComesAsARevisionAndDoesNotTouchTheFinalMap) {
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

TEST(MergerDeterminism, TheFinalMapIsAFunctionOfStreamAndDecisionsWheneverTheyWereMade) {
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

TEST(MergerDeterminism, TheMapIsTheSameHoweverFewKeyframesAreHeld) {
  struct RecordSource : KeyframeSource {
    explicit RecordSource(const std::vector<Record>& all) : records(all) {}
    KeyframeRecord Read(const std::string&, int64_t seq) override {
      return std::get<KeyframeRecord>(records.at(seq).body);
    }
    const std::vector<Record>& records;
  };
  const SyntheticFlight flight = ThreeCrossingStrips();
  MergerOptions options;
  options.search.connected_frames.max_window_size = 18;  // with the usual 6 on the other side 24 keyframes
  BruteForceBow bow(flight.records());
  RecordSource source(flight.records());
  Recorder all, few;
  Merger holds_all(options, &bow, &all);
  options.search.max_cached_keyframes = 24;
  ASSERT_EQ(options.Check(), "");
  Merger merger(options, &bow, &few, &source);
  const auto open = [&] { return std::make_unique<RecordSource>(flight.records()); };
  int num_refined = 0;
  for (const Record& r : flight.records()) {
    ASSERT_EQ(holds_all.Consume(r), "");
    ASSERT_EQ(merger.Consume(r), "");
    EXPECT_LE(merger.keyframe_cache().num_loaded(), 24);
    ASSERT_EQ(merger.RefinementIsDue(), holds_all.RefinementIsDue());
    if (!merger.RefinementIsDue()) continue;
    ASSERT_EQ(merger.TakeRefinement(RunRefinement(merger.MakeRefinement(), {}, open)),
              holds_all.TakeRefinement(RunRefinement(holds_all.MakeRefinement(), {})));
    EXPECT_EQ(Digest(few), Digest(all));
    ++num_refined;
  }
  EXPECT_GE(num_refined, 2);
  holds_all.Finalize();
  EXPECT_EQ(holds_all.keyframe_cache().num_loaded(), 28);
  EXPECT_EQ(holds_all.keyframe_cache().num_reads(), 0);
  merger.Finalize();
  EXPECT_GT(merger.keyframe_cache().num_reads(), 4);
  int complete = 0;
  for (const auto& [id, submap] : merger.sessions().begin()->second.submaps) {
    for (const auto& [k, keyframe] : submap.keyframes) {
      complete += !keyframe.features.descriptors.empty();
      // Nothing is kept of a feature that is beyond the cache, but what it observes.
      EXPECT_EQ(keyframe.features.keypoints.size(), keyframe.features.descriptors.size());
      EXPECT_EQ(keyframe.nodes.size(), keyframe.features.descriptors.size());
      EXPECT_EQ(keyframe.features.keypoints.capacity() > 0, !keyframe.features.keypoints.empty());
    }
  }
  EXPECT_EQ(complete, 24);
  EXPECT_EQ(Digest(few), Digest(all));
}

TEST(MergerDeterminism, TheSeedIsTheFlightsOwnUnlessOneIsGiven) {
  const SyntheticFlight flight = ThreeCrossingStrips();
  BruteForceBow bow({});
  const auto seed = [&](const std::string& settings, std::optional<uint64_t> given) {
    Recorder out;
    MergerOptions options;
    options.seed = given;
    Merger merger(options, &bow, &out);
    Record start = flight.records().front();
    std::get<SessionStarted>(start.body).settings_json = settings;
    EXPECT_EQ(merger.Consume(start), "");
    return merger.seed();
  };
  EXPECT_EQ(seed(R"({"seed": 7, "num_features": 1000})", std::nullopt), 7u);
  EXPECT_EQ(seed(R"({"seed": 7})", 3), 3u);
  for (const char* silent : {"{}", "", "[7]", "7", R"({"seed": "7"})", R"({"seed": -7})", R"({"seed": 7)"}) {
    EXPECT_EQ(seed(silent, std::nullopt), 1u) << silent;
  }
}

TEST(MergerDeterminism, OfSeveralFlightsTheSeedIsThatOfTheNewest) {
  std::map<std::string, Session> sessions;
  EXPECT_FALSE(SeedOfFlights(sessions));
  sessions["b"].start_utime = 2000;
  sessions["b"].info.settings_json = R"({"seed": 4})";
  sessions["a"].start_utime = 3000;
  sessions["a"].info.settings_json = R"({"seed": 5})";
  EXPECT_EQ(SeedOfFlights(sessions), 5u);
  sessions["b"].start_utime = 3000;
  EXPECT_EQ(SeedOfFlights(sessions), 4u);
}

TEST(MergerDeterminism, ARefinementLeavesOutEvidenceWhoseKeyframeWasCulled) {
  const SyntheticFlight flight = ThreeCrossingStrips();
  BruteForceBow bow(flight.records());
  Recorder out;
  Merger merger({}, &bow, &out);
  const auto num_agreeing = [&] {
    long n = 0;
    for (const Connection& c : merger.connections()) n += std::count(c.agrees.begin(), c.agrees.end(), true);
    return n;
  };
  RecordHeader last;
  for (const Record& r : flight.records()) {
    ASSERT_EQ(merger.Consume(r), "");
    last = r.header;
    if (num_agreeing() >= 3) break;
  }
  const Connection connection = merger.connections().front();
  ASSERT_EQ(connection.verdict, Connection::Verdict::kAccepted) << connection.reason;
  ASSERT_FALSE(merger.sessions().at(connection.b.session).submaps.at(connection.b.submap).ended);
  const size_t num_links = merger.MakeRefinement().links.size();
  ASSERT_GE(num_links, 3u);

  // The frontend culls the keyframe that the first of them rests on, in the submap that still grows.
  const KeyframeId culled = connection.evidence.front().keyframe_b;
  Record record;
  record.header = {last.session, last.seq + 1, last.utime + 1};
  record.body = MapUpdate{connection.b.submap, {}, {}, {}, {culled}, {}, {}};
  ASSERT_EQ(merger.Consume(record), "");
  const RefinementTask task = merger.MakeRefinement();
  EXPECT_LT(task.links.size(), num_links);
  EXPECT_GE(task.links.size(), 1u);
  for (const RefinementLink& link : task.links) {
    EXPECT_TRUE(task.parts[link.submap_a].submap->keyframes.contains(link.keyframe_a));
    EXPECT_TRUE(task.parts[link.submap_b].submap->keyframes.contains(link.keyframe_b));
  }
  EXPECT_TRUE(merger.TakeRefinement(RunRefinement(task, {})));
}

}  // namespace merger_determinism_test
}  // namespace mapmend
