#include "libs/connecting/connection_search.h"

#include <gtest/gtest.h>

#include <optional>

#include "tests/synthetic_flight.h"

namespace mapmend {
namespace connection_search_test {

using testing::MakeTerrain;
using testing::Strip;
using testing::SyntheticFlight;
using testing::TerrainPoint;

const SubmapKey kFirst{"s", SubmapId(0)}, kSecond{"s", SubmapId(1)};
const SubmapPair kPair{kFirst, kSecond};

// Proposes what the test says, and remembers who asked.
struct ToldBow : BowSource {
  std::vector<BowProposal> Query(const BowQuestion& question) override {
    asked.push_back(question.keyframe);
    return proposals;
  }
  std::vector<BowProposal> proposals;
  std::vector<KeyframeId> asked;
};

class ConnectionSearchTest : public ::testing::Test {
 protected:
  // Two submaps over the same ground, the second one at another height.
  void Fly(double altitude, int num_keyframes) {
    std::mt19937_64 random(8);
    static const std::vector<TerrainPoint> terrain = MakeTerrain({});
    SyntheticFlight flight("s", 0, terrain, {});
    flight.AddSubmap(Strip({100, 100}, {200, 100}, 100, 6, 90, &random), Similarity3());
    flight.AddSubmap(Strip({100, 110}, {200, 110}, altitude, num_keyframes, 90, &random), Similarity3());
    flight.End();
    sessions_.emplace("s", flight.Model());
    for (const auto& [id, keyframe] : Of(kFirst).keyframes) first_.push_back(id);
    for (const auto& [id, keyframe] : Of(kSecond).keyframes) second_.push_back(id);
    options_.neighbors.num_submaps = 0;
  }
  const Submap& Of(const SubmapKey& key) const { return *ViewSubmap(sessions_, key).submap; }
  ConnectionSearch& Search() {
    if (!search_) search_.emplace(options_, &sessions_, &bow_, nullptr, [this] { ++num_signs_of_life_; });
    return *search_;
  }
  void Propose(const SubmapKey& submap, KeyframeId keyframe) {
    bow_.proposals.push_back({submap.session, submap.submap, keyframe, 1.0});
  }

  Sessions sessions_;
  std::vector<KeyframeId> first_, second_;
  ConnectionSearchOptions options_;
  ToldBow bow_;
  int num_signs_of_life_ = 0;
  std::optional<ConnectionSearch> search_;
  ConnectionGraph graph_{{}};
};

TEST_F(ConnectionSearchTest, AKeyframeAsksWhenItsPointsHaveCome) {
  Fly(100, 6);
  Propose(kFirst, first_[2]);
  EXPECT_EQ(Search().OnMapUpdate("s", &graph_), std::nullopt);
  Search().OnKeyframe(kSecond, second_[2]);
  EXPECT_TRUE(bow_.asked.empty());
  EXPECT_EQ(Search().OnMapUpdate("s", &graph_), std::set<SubmapPair>{kPair});
  EXPECT_EQ(bow_.asked, std::vector<KeyframeId>{second_[2]});
  EXPECT_EQ(num_signs_of_life_, 1);
  ASSERT_EQ(graph_.connections().at(kPair).evidence.size(), 1u);
  EXPECT_EQ(graph_.connections().at(kPair).evidence[0].keyframe_a, first_[2]);
  EXPECT_EQ(Search().OnMapUpdate("s", &graph_), std::nullopt);
}

TEST_F(ConnectionSearchTest, AtTheEndOfASubmapWhatWaitsAsks) {
  Fly(100, 6);
  Propose(kFirst, first_[1]);
  Search().OnKeyframe(kSecond, second_[1]);
  EXPECT_EQ(Search().OnSubmapEnd(kSecond, &graph_), std::set<SubmapPair>{kPair});
}

TEST_F(ConnectionSearchTest, OneAcceptedPairPerSubmapIsEnoughAndAFewAreTried) {
  Fly(100, 6);
  for (const KeyframeId id : {first_[2], first_[1], first_[3]}) Propose(kFirst, id);
  Search().OnKeyframe(kSecond, second_[2]);
  Search().OnMapUpdate("s", &graph_);
  EXPECT_EQ(graph_.connections().at(kPair).num_candidates, 1);

  ConnectionGraph strict{{}};
  options_.connected_frames.min_inliers = 100000;
  options_.max_verified_per_submap = 2;
  search_.reset();
  Search().OnKeyframe(kSecond, second_[2]);
  Search().OnMapUpdate("s", &strict);
  EXPECT_EQ(strict.connections().at(kPair).num_candidates, 2);
}

TEST_F(ConnectionSearchTest, OpenKeyframesOfAnEndedSubmapAreAskedAgainOneByOne) {
  Fly(100, 6);
  for (const KeyframeId id : second_) Search().OnKeyframe(kSecond, id);
  Search().OnSubmapEnd(kSecond, &graph_);  // nothing is proposed yet
  ASSERT_EQ(bow_.asked.size(), second_.size());
  EXPECT_TRUE(graph_.connections().empty());
  Propose(kFirst, first_[3]);
  Search().AskAgain(&graph_);
  ASSERT_EQ(bow_.asked.size(), second_.size() + 1);
  EXPECT_EQ(graph_.connections().at(kPair).num_candidates, 1);
  // What it has found is told with the next keyframe.
  Search().OnKeyframe(kFirst, first_[0]);
  bow_.proposals.clear();
  EXPECT_EQ(Search().OnMapUpdate("s", &graph_), std::set<SubmapPair>{kPair});
}

TEST_F(ConnectionSearchTest, KeyframesThatAreConnectedAreNotAskedAgain) {
  Fly(100, 6);
  Propose(kFirst, first_[2]);
  Search().OnKeyframe(kSecond, second_[2]);
  Search().OnSubmapEnd(kSecond, &graph_);
  bow_.asked.clear();
  for (size_t i = 0; i < 2 * second_.size(); ++i) Search().AskAgain(&graph_);
  EXPECT_FALSE(bow_.asked.empty());
  for (const KeyframeId id : bow_.asked) EXPECT_NE(id, second_[2]);
}

TEST_F(ConnectionSearchTest, FromVeryDifferentHeightsASecondWiderLookFindsIt) {
  // The low keyframes see so little that six of them do not show enough of what the high ones see.
  Fly(25, 40);
  options_.connected_frames.min_inliers = 60;
  options_.max_verified_per_submap = 1;
  const SubmapView a = ViewSubmap(sessions_, kFirst), b = ViewSubmap(sessions_, kSecond);
  int num_wider = 0;
  for (const KeyframeId low : second_) {
    const ConnectedFrames usual = VerifyConnectedFrames(a, first_[2], b, low, options_.connected_frames);
    if (usual.success || std::max(usual.wanted.a, usual.wanted.b) < 2 * options_.connected_frames.window_size) continue;
    if (!VerifyConnectedFrames(a, first_[2], b, low, options_.connected_frames, usual.wanted).success) continue;
    ++num_wider;
    ConnectionGraph graph{{}};
    bow_.proposals.clear();
    Propose(kFirst, first_[2]);
    search_.reset();
    Search().OnKeyframe(kSecond, low);
    Search().OnMapUpdate("s", &graph);
    EXPECT_EQ(graph.connections().at(kPair).evidence.size(), 1u);
  }
  EXPECT_GT(num_wider, 0);
}

TEST_F(ConnectionSearchTest, TheSecondPassAsksAllKeyframesAndForgetsWhatWaited) {
  Fly(100, 6);
  Search().OnKeyframe(kSecond, second_[0]);
  Propose(kFirst, first_[2]);
  EXPECT_EQ(Search().SearchAll(&graph_), std::set<SubmapPair>{kPair});
  EXPECT_EQ(bow_.asked.size(), first_.size() + second_.size());
  EXPECT_EQ(Search().OnMapUpdate("s", &graph_), std::nullopt);
}

}  // namespace connection_search_test
}  // namespace mapmend
