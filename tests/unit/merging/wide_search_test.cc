#include "libs/connecting/wide_search.h"

#include <gtest/gtest.h>

#include <map>

#include "libs/base/random.h"
#include "libs/merging/merger.h"
#include "tests/merger_fixture.h"
#include "tests/synthetic_flight.h"
#include "tests/unit/connecting/wide_world.h"

namespace mapmend {
namespace wide_search_test {

using testing::BruteForceBow;
using testing::Digest;
using testing::FlightOptions;
using testing::Frame;
using testing::Recorder;
using testing::Strip;
using testing::SyntheticFlight;
using testing::Terrain;
using testing::WidePoint;

constexpr char kSession[] = "11111111-0000-0000-0000-000000000000";

// Ground as wide features see it.
std::vector<WidePoint> MakeGround(uint64_t seed) {
  Random random(seed);
  std::vector<WidePoint> ground;
  for (int i = 0; i < 9000; ++i) {
    WidePoint& p = ground.emplace_back();
    p.position = {400 * random.Uniform(), 400 * random.Uniform(), 4 * testing::Gauss(&random)};
    p.size = 0.8 * std::pow(2, 3 * random.Uniform());
    p.descriptor = testing::RandomDescriptor(&random);
  }
  return ground;
}

WideFeatures See(const std::vector<WidePoint>& ground, const Rigid3& world_from_cam, const Pinhole& camera,
                 Random* random) {
  WideFeatures features;
  const Rigid3 cam_from_world = world_from_cam.Inverse();
  for (const WidePoint& p : ground) {
    const Eigen::Vector3d x = cam_from_world * p.position;
    if (!(x.z() > 1)) continue;
    const Eigen::Vector2d pixel =
        camera.Project(x) + 0.5 * Eigen::Vector2d(testing::Gauss(random), testing::Gauss(random));
    if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= camera.width || pixel.y() >= camera.height) continue;
    const double size = WideKeypoint::kSizesPerOctave * std::log2(p.size * camera.fx / x.z());
    features.keypoints.push_back({pixel.cast<float>(), static_cast<uint8_t>(std::max(0.0, size)), 0});
    features.descriptors.push_back(p.descriptor);
  }
  return features;
}

// The records of a flight, and behind them the wide features of all its keyframes; then its end.
std::vector<Record> WithWide(const SyntheticFlight& flight, const std::vector<WidePoint>& ground) {
  std::vector<Record> records = flight.records();
  const Record end = records.back();
  records.pop_back();
  Random random(3);
  const std::vector<Record> told = records;
  for (const Record& r : told) {
    const auto* keyframe = std::get_if<KeyframeRecord>(&r.body);
    if (keyframe == nullptr) continue;
    WideFeaturesRecord wide;
    wide.submap = keyframe->submap;
    wide.keyframe = keyframe->keyframe;
    wide.frame = keyframe->frame;
    wide.features =
        See(ground, flight.world_from_keyframe()[keyframe->keyframe.value], FlightOptions().camera, &random);
    records.push_back({{kSession, static_cast<int64_t>(records.size()), r.header.utime}, std::move(wide)});
  }
  records.push_back({{kSession, static_cast<int64_t>(records.size()), end.header.utime}, end.body});
  return records;
}

// Two strips in one line, the second from twice as high; the ground between them is seen from both ends.
SyntheticFlight TwoStrips() {
  std::mt19937_64 random(31);
  SyntheticFlight flight(kSession, 1000, Terrain(), {});
  flight.AddSubmap(Strip({60, 200}, {160, 200}, 80, 9, 90, &random), Frame(0.02, 0.3));
  flight.AddSubmap(Strip({200, 200}, {300, 200}, 150, 9, 90, &random), Frame(0.05, -0.9));
  flight.End();
  return flight;
}

Sessions Apply(const std::vector<Record>& records) {
  Sessions sessions;
  for (const Record& r : records) EXPECT_EQ(sessions[r.header.session].Apply(r), "");
  return sessions;
}

// Retrieval that knows nothing.
struct NoBow : BowSource {
  std::vector<BowProposal> Query(const BowQuestion&) override { return {}; }
};

MergerOptions WithoutNeighbors() {
  MergerOptions options;
  options.search.neighbors.num_keyframes = 0;  // else ORB joins them
  return options;
}

TEST(WideSearch, JoinsWhatNothingElseHasJoined) {
  const SyntheticFlight flight = TwoStrips();
  const Sessions sessions = Apply(WithWide(flight, MakeGround(1)));
  ConnectionGraph graph{ConnectionGraphOptions{}};
  WideSearch search({}, &sessions, nullptr, [] {});
  EXPECT_EQ(search.Bridge(&graph).size(), 1u);
  ASSERT_EQ(graph.connections().size(), 1u);
  const Connection& c = graph.connections().begin()->second;
  ASSERT_EQ(c.verdict, Connection::Verdict::kAccepted) << c.reason;
  EXPECT_EQ(c.kind, ConnectionKind::kWide);
  EXPECT_TRUE(c.in_tree);
  EXPECT_TRUE(c.reason.starts_with(ReasonPrefix(ConnectionKind::kWide))) << c.reason;
  EXPECT_EQ(graph.forest().num_components, 1);
  const Similarity3 truth = flight.submap_from_world()[1] * flight.submap_from_world()[0].Inverse();
  EXPECT_NEAR(c.b_from_a.scale / truth.scale, 1, 0.02);
  EXPECT_LT(RotationAngle(c.b_from_a.rotation * truth.rotation.conjugate()), 0.01);
}

TEST(WideSearch, OtherGroundIsNotJoined) {
  const SyntheticFlight flight = TwoStrips();
  std::vector<Record> records = WithWide(flight, MakeGround(1)), other = WithWide(flight, MakeGround(2));
  for (size_t i = 0; i < records.size(); ++i) {
    const auto* wide = std::get_if<WideFeaturesRecord>(&records[i].body);
    if (wide != nullptr && wide->submap == SubmapId(1)) records[i] = other[i];
  }
  const Sessions sessions = Apply(records);
  ConnectionGraph graph{ConnectionGraphOptions{}};
  WideSearch search({}, &sessions, nullptr, [] {});
  search.Bridge(&graph);
  EXPECT_EQ(graph.num_accepted(), 0);
  EXPECT_EQ(graph.forest().num_components, 2);
}

TEST(WideSearch, APersonsWordCounts) {
  const Sessions sessions = Apply(WithWide(TwoStrips(), MakeGround(1)));
  ConnectionGraph graph{ConnectionGraphOptions{}};
  graph.SetDecisions({{{kSession, SubmapId(1)}, {kSession, SubmapId(0)}, true}});
  WideSearch search({}, &sessions, nullptr, [] {});
  search.Bridge(&graph);
  const Connection& c = graph.connections().begin()->second;
  EXPECT_EQ(c.verdict, Connection::Verdict::kDeactivated) << c.reason;
  EXPECT_TRUE(c.reason.starts_with(ReasonPrefix(ConnectionKind::kWide))) << c.reason;
  EXPECT_EQ(graph.forest().num_components, 2);
}

// A gap of photos that were not tracked leads from a height to a tenth of it, where no two photos that were have
// anything in common.
TEST(WideSearch, PhotosBetweenSubmapsLeadFromOneToTheOther) {
  std::mt19937_64 random(31);
  SyntheticFlight flight(kSession, 1000, Terrain(), {});
  flight.AddSubmap(Strip({180, 200}, {220, 200}, 160, 8, 90, &random), Frame(0.02, 0.3));
  flight.AddSubmap(Strip({198, 200}, {202, 200}, 16, 8, 90, &random), Frame(0.3, -0.9));
  flight.End();
  Random noise(9);
  std::vector<WidePoint> ground;  // of all sizes, more small ones
  for (int i = 0; i < 60000; ++i) {
    WidePoint& p = ground.emplace_back();
    p.size = 0.1 * std::pow(2, 6 * std::pow(noise.Uniform(), 1.5));
    const double reach = std::min(200.0, 100 * p.size);
    p.position = {200 + reach * (2 * noise.Uniform() - 1), 200 + reach * (2 * noise.Uniform() - 1),
                  0.5 * testing::Gauss(&noise)};
    p.descriptor = testing::RandomDescriptor(&noise);
  }
  const auto limit = [](WideFeatures all) {  // as a detector finds them
    WideFeatures seen;
    for (int i = 0; i < all.Size() && seen.Size() < 2500; ++i) {
      if (all.keypoints[i].SizePx() < 3 || all.keypoints[i].SizePx() > 12) continue;
      seen.keypoints.push_back(all.keypoints[i]);
      seen.descriptors.push_back(all.descriptors[i]);
    }
    return seen;
  };
  std::vector<Record> records = WithWide(flight, ground);
  for (Record& r : records) {
    if (auto* wide = std::get_if<WideFeaturesRecord>(&r.body)) wide->features = limit(std::move(wide->features));
  }
  std::vector<Record> with_photos = records;
  const Record end = with_photos.back();
  with_photos.pop_back();
  int index = 100;
  for (const double height : {110.0, 76.0, 52.0, 36.0, 25.0}) {
    WideFeaturesRecord photo;
    photo.submap = SubmapId(0);
    photo.frame = index++;
    photo.features = limit(See(ground, testing::NadirPose(201, 200, height, 90), FlightOptions().camera, &noise));
    with_photos.push_back({{kSession, static_cast<int64_t>(with_photos.size()), 9000000 + index}, std::move(photo)});
  }
  with_photos.push_back({{kSession, static_cast<int64_t>(with_photos.size()), end.header.utime}, end.body});

  for (const bool has_photos : {false, true}) {
    const Sessions sessions = Apply(has_photos ? with_photos : records);
    ConnectionGraph graph{ConnectionGraphOptions{}};
    WideSearchOptions options;
    options.connection.max_speed = 1000;  // the times of this flight are made up
    WideSearch search(options, &sessions, nullptr, [] {});
    search.Bridge(&graph);
    const Connection& c = graph.connections().begin()->second;
    ASSERT_EQ(c.verdict == Connection::Verdict::kAccepted, has_photos) << c.reason;
    if (!has_photos) continue;
    const Similarity3 truth = flight.submap_from_world()[1] * flight.submap_from_world()[0].Inverse();
    EXPECT_NEAR(c.b_from_a.scale / truth.scale, 1, 0.05) << c.reason;
  }
}

// Wide features that are read again give the same map as those that are held, and the merger does not hold them.
TEST(WideSearch, TheMapIsAFunctionOfTheStream) {
  const std::vector<Record> records = WithWide(TwoStrips(), MakeGround(1));
  struct Source : KeyframeSource {
    explicit Source(const std::vector<Record>* r) : all(r) {}
    KeyframeRecord Read(const std::string&, int64_t seq) override {
      return std::get<KeyframeRecord>((*all)[static_cast<size_t>(seq)].body);
    }
    WideFeaturesRecord ReadWide(const std::string&, int64_t seq) override {
      ++num_read;
      return std::get<WideFeaturesRecord>((*all)[static_cast<size_t>(seq)].body);
    }
    const std::vector<Record>* all;
    int num_read = 0;
  } source(&records);
  std::vector<std::string> digests;
  for (KeyframeSource* from : {static_cast<KeyframeSource*>(nullptr), static_cast<KeyframeSource*>(&source)}) {
    Recorder out;
    NoBow bow;
    Merger merger(WithoutNeighbors(), &bow, &out, from);
    for (const Record& r : records) ASSERT_EQ(merger.Consume(r), "");
    for (const auto& [id, submap] : merger.sessions().at(kSession).submaps) {
      for (const auto& [keyframe, wide] : submap.wide) EXPECT_EQ(wide.features == nullptr, from != nullptr);
    }
    merger.Finalize();
    ASSERT_EQ(out.revision.edges.size(), 1u);
    digests.push_back(Digest(out));
    EXPECT_LT(testing::MergedError(out, TwoStrips().world_from_keyframe()), 3.0);
  }
  EXPECT_EQ(digests[0], digests[1]);
  EXPECT_GE(source.num_read, 16);
}

// Where ORB has joined everything, wide features change nothing.
TEST(WideSearch, WhatIsJoinedStaysAsItIs) {
  const SyntheticFlight flight = testing::ThreeCrossingStrips();
  std::vector<std::string> digests;
  for (const std::vector<Record>& records : {flight.records(), WithWide(flight, MakeGround(1))}) {
    Recorder out;
    BruteForceBow bow(records);
    Merger merger({}, &bow, &out);
    for (const Record& r : records) ASSERT_EQ(merger.Consume(r), "");
    merger.Finalize();
    EXPECT_EQ(out.revision.edges.size(), 2u);
    out.revision.revision = 0;
    digests.push_back(Digest(out));
  }
  EXPECT_EQ(digests[0], digests[1]);
}

}  // namespace wide_search_test
}  // namespace mapmend
