#include "libs/merging/restoration_log.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <iterator>

#include "libs/connecting/connection_graph.h"
#include "tests/synthetic_flight.h"

namespace mapmend {
namespace restoration_log_test {

using testing::MakeTerrain;
using testing::Strip;
using testing::SyntheticFlight;
using testing::TerrainPoint;

struct Row {
  const char* L1;
  const char* L2;
};

// Table 1 of the paper.
const Row kTable1[] = {
    {"", "A"},
    {"A", "B"},
    {"A, B", "C"},
    {"A, B, C", "D"},
    {"A, B", "D-C"},
    {"A", "D-C-B"},
    {"A, D-C-B", "E"},
    {"", "E-D-C-B-A"},
    {"E-D-C-B-A", "F"},
    {"", "F-E-D-C-B-A"},
    {"F-E-D-C-B-A", "G"},
    {"", "G-F-E-D-C-B-A"},
    {"G-F-E-D-C-B-A", "H"},
    {"", "H-G-F-E-D-C-B-A"},
    {"H-G-F-E-D-C-B-A", "I"},
    {"", "I-H-G-F-E-D-C-B-A"},
};

// The submaps A to I of Figure 5. Here all see the same ground, so that any two may be connected; the connected frames
// that the graph is given are those of the paper: D finds C, later B; one frame of E finds D and A; then each finds the
// one before it.
class NineSubmaps : public ::testing::Test {
 protected:
  static constexpr int kKeyframes = 5;  // of a submap

  NineSubmaps() {
    std::mt19937_64 random(5);
    static const std::vector<TerrainPoint> terrain = MakeTerrain({});
    SyntheticFlight flight("s", 0, terrain, {});
    for (int i = 0; i < 9; ++i) {
      Similarity3 frame;
      frame.scale = 0.02 + 0.005 * i;
      flight.AddSubmap(Strip({80, 80.0 + 3 * i}, {200, 80.0 + 3 * i}, 100, kKeyframes, 90, &random), frame);
    }
    flight.End();
    sessions_.emplace("s", flight.Model());
  }

  // Keyframe `at` of the younger submap sees the same ground as the same one of the older.
  void Connect(int older, int younger, int at) {
    const SubmapPair pair{{"s", SubmapId(older)}, {"s", SubmapId(younger)}};
    ConnectedFrames frames =
        VerifyConnectedFrames(ViewSubmap(sessions_, pair.older), KeyframeId(kKeyframes * older + at),
                              ViewSubmap(sessions_, pair.younger), KeyframeId(kKeyframes * younger + at), {});
    ASSERT_TRUE(frames.success) << frames.reason;
    graph_.Add(pair, std::move(frames));
    pairs_.insert(pair);
  }

  std::vector<RestorableSubmap> Submaps() const {
    std::vector<RestorableSubmap> submaps;
    for (const auto& [id, submap] : sessions_.at("s").submaps) {
      const SubmapKeyframe &first = submap.keyframes.begin()->second, &last = submap.keyframes.rbegin()->second;
      submaps.push_back({{"s", id}, first.utime, first.frame, true, last.utime});
    }
    return submaps;
  }

  std::vector<RestorableConnection> Connections() const {
    std::vector<RestorableConnection> found;
    for (const auto& [pair, connection] : graph_.connections()) {
      if (!graph_.IsAccepted(pair)) continue;
      RestorableConnection joint{pair.older.submap.value, pair.younger.submap.value, INT64_MAX, -1};
      const Submap& younger = sessions_.at("s").submaps.at(pair.younger.submap);
      for (const ConnectedFrames& frames : connection.evidence) {
        const SubmapKeyframe& keyframe = younger.keyframes.at(frames.keyframe_b);
        if (keyframe.utime < joint.utime) joint.utime = keyframe.utime, joint.frame = keyframe.frame;
      }
      found.push_back(joint);
    }
    return found;
  }

  Sessions sessions_;
  ConnectionGraph graph_{ConnectionGraphOptions()};
  std::set<SubmapPair> pairs_;
};

TEST_F(NineSubmaps, AreMergedAsInTable1) {
  constexpr int A = 0, B = 1, C = 2, D = 3, E = 4, F = 5, G = 6, H = 7, I = 8;
  Connect(C, D, 1);
  Connect(B, D, 3);
  Connect(D, E, 2);
  Connect(A, E, 2);
  for (const auto& [older, younger] : {std::pair(E, F), {F, G}, {G, H}, {H, I}}) Connect(older, younger, 2);
  Connect(C, I, 4);  // joins nothing that is not one already
  graph_.Solve(sessions_, pairs_, false);
  ASSERT_EQ(graph_.num_accepted(), 9);
  ASSERT_EQ(graph_.forest().num_components, 1);

  const std::vector<RestorationStep> steps = Restore(Submaps(), Connections());
  ASSERT_EQ(steps.size(), std::size(kTable1));
  for (size_t i = 0; i < steps.size(); ++i) {
    SCOPED_TRACE("row " + std::to_string(i + 1));
    EXPECT_EQ(StackLetters(steps[i].unrecovered), kTable1[i].L1);
    EXPECT_EQ(StackLetters(steps[i].tracked), kTable1[i].L2);
  }
  EXPECT_EQ(steps[7].connections.size(), 2u);  // a frame of E recovers two maps
  EXPECT_EQ(steps[7].frame, kKeyframes * E + 2);
  EXPECT_EQ(steps[1].lost, A);
}

TEST_F(NineSubmaps, WithoutConnectionsStayOnTheStack) {
  const std::vector<RestorationStep> steps = Restore(Submaps(), {});
  ASSERT_EQ(steps.size(), 9u);
  EXPECT_EQ(StackLetters(steps.back().unrecovered), "A, B, C, D, E, F, G, H");
  EXPECT_EQ(StackLetters(steps.back().tracked), "I");
}

RestorableSubmap Lasting(const char* session, int64_t begin, int64_t end) {
  return {{session, SubmapId(0)}, begin, 0, true, end};
}

// Two vehicles in the air at a time: both are tracked; what the second one is connected with need not be lost.
TEST(RestorationLog, TwoVehiclesAreTrackedAtATime) {
  const std::vector<RestorationStep> steps = Restore({Lasting("a", 0, 100), Lasting("b", 50, 150)}, {{0, 1, 70, 7}});
  ASSERT_EQ(steps.size(), 3u);
  EXPECT_EQ(StackLetters(steps[1].tracked), "A, B");
  EXPECT_EQ(steps[1].lost, -1);  // nothing of its own
  EXPECT_EQ(StackLetters(steps[2].tracked), "B-A");
  EXPECT_TRUE(steps[2].unrecovered.empty());
}

TEST(RestorationLog, AFlightAfterAnotherFindsItOnTheStack) {
  const std::vector<RestorationStep> steps = Restore({Lasting("a", 0, 100), Lasting("b", 200, 300)}, {{0, 1, 250, 7}});
  ASSERT_EQ(steps.size(), 3u);
  EXPECT_EQ(StackLetters(steps[1].unrecovered), "A");
  EXPECT_EQ(StackLetters(steps[2].tracked), "B-A");
  EXPECT_EQ(steps[2].event, RestorationStep::Event::kMerge);
}

// The first frames of a new map may have been tracked in the lost one as well; its last frame may find another map.
TEST(RestorationLog, ALossEndsASubmapWhenTheNextBegins) {
  std::vector<RestorableSubmap> submaps = {Lasting("a", 0, 100), Lasting("a", 90, 200), Lasting("a", 300, 400)};
  for (int i = 0; i < 3; ++i) submaps[i].key.submap = SubmapId(i);
  const std::vector<RestorationStep> steps = Restore(submaps, {{0, 1, 200, 7}});
  ASSERT_EQ(steps.size(), 4u);
  EXPECT_EQ(StackLetters(steps[1].unrecovered), "A");
  EXPECT_EQ(StackLetters(steps[1].tracked), "B");
  EXPECT_EQ(StackLetters(steps[2].tracked), "B-A");
  EXPECT_EQ(StackLetters(steps[3].unrecovered), "B-A");
  EXPECT_EQ(StackLetters(steps[3].tracked), "C");
}

TEST(RestorationLog, LettersGoOnAfterZ) {
  EXPECT_EQ(SubmapLetters(0), "A");
  EXPECT_EQ(SubmapLetters(25), "Z");
  EXPECT_EQ(SubmapLetters(26), "AA");
  EXPECT_EQ(SubmapLetters(27), "AB");
  EXPECT_EQ(SubmapLetters(26 + 26 * 26), "AAA");
}

}  // namespace restoration_log_test
}  // namespace mapmend
