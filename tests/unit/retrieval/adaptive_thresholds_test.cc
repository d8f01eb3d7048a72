#include "libs/retrieval/adaptive_thresholds.h"

#include <gtest/gtest.h>

#include <map>

namespace mapmend {
namespace adaptive_thresholds_test {

BowVector Bow(std::vector<int32_t> words) {
  BowVector bow;
  bow.weights.assign(words.size(), 1.0f / static_cast<float>(words.size()));
  bow.words = std::move(words);
  return bow;
}

const std::function<std::vector<int32_t>(int32_t)> kNoNeighbors = [](int32_t) { return std::vector<int32_t>(); };

TEST(ChooseNearby, TakesTheOverlapClosestToHalf) {
  const ThresholdOptions options;
  EXPECT_EQ(ChooseNearby({{1, 0.9}, {2, 0.7}, {3, 0.45}, {4, 0.3}}, 1, options), 3);
  EXPECT_EQ(ChooseNearby({{1, 0.9}, {5, 0.6}, {4, 0.4}}, 1, options), 4);  // tie: smaller id
  EXPECT_EQ(ChooseNearby({{1, 0.5}, {2, 0.3}}, 1, options), 2);            // never the adjacent one
  EXPECT_EQ(ChooseNearby({{1, 0.9}, {2, 0.85}, {3, 0.1}}, 1, options), -1);
  EXPECT_EQ(ChooseNearby({}, -1, options), -1);
}

TEST(ComputeThresholds, AreRatiosOfNearbyToAdjacent) {
  const BowVector query = Bow({1, 2, 3, 4, 5, 6, 7, 8, 9, 10});
  const BowVector adjacent = Bow({1, 2, 3, 4, 5, 6, 7, 8, 20, 21});
  const BowVector nearby = Bow({1, 2, 3, 4, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 44, 45});
  const AdaptiveThresholds t = ComputeThresholds(query, &adjacent, &nearby, {});
  EXPECT_TRUE(t.adapted);
  EXPECT_EQ(t.n0, 8);
  EXPECT_EQ(t.n1, 4);
  EXPECT_NEAR(t.s0, 0.8, 1e-6);
  EXPECT_NEAR(t.s1, 0.2, 1e-6);  // 4 words of weight min(0.1, 0.05)
  EXPECT_NEAR(t.k, 0.5, 1e-6);
  EXPECT_NEAR(t.l, 0.3, 1e-6);  // 0.25, clamped
  const AdaptiveThresholds swapped = ComputeThresholds(query, &nearby, &adjacent, {});
  EXPECT_EQ(swapped.k, 1.0);
  EXPECT_EQ(swapped.l, 1.0);
}

TEST(ComputeThresholds, FallBackWithoutUsableNeighbours) {
  const BowVector query = Bow({1, 2}), other = Bow({8, 9});
  for (const auto& [adjacent, nearby] : {std::pair<const BowVector*, const BowVector*>(nullptr, nullptr),
                                         {&query, nullptr},
                                         {nullptr, &query},
                                         {&query, &other},
                                         {&other, &query}}) {
    const AdaptiveThresholds t = ComputeThresholds(query, adjacent, nearby, {});
    EXPECT_FALSE(t.adapted);
    EXPECT_EQ(t.k, 0.8);
    EXPECT_EQ(t.l, 0.75);
  }
}

TEST(SelectCandidates, DropsHitsBelowKTimesTheMaximum) {
  AdaptiveThresholds thresholds;
  thresholds.k = 0.5;
  thresholds.l = 0.3;
  const std::vector<IndexHit> hits = {{0, 100, 500, 0.2f}, {1, 50, 500, 0.1f}, {2, 49, 500, 0.19f}};
  const Selection s = SelectCandidates(hits, 500, thresholds, kNoNeighbors, {});
  EXPECT_EQ(s.max_common_words, 100);
  ASSERT_EQ(s.candidates.size(), 2u);
  EXPECT_EQ(s.candidates[0].handle, 0);
  EXPECT_EQ(s.candidates[1].handle, 1);
}

TEST(SelectCandidates, LargeKeyframesDoNotSwampOthers) {
  // Handle 0 has five times the words and by that alone shares most.
  const std::vector<IndexHit> hits = {{0, 150, 2500, 0.05f}, {1, 100, 500, 0.2f}};
  EXPECT_DOUBLE_EQ(NormalizedCommonWords(150, 2500, 500), 30);
  EXPECT_DOUBLE_EQ(NormalizedCommonWords(100, 500, 500), 100);
  EXPECT_DOUBLE_EQ(NormalizedCommonWords(40, 50, 500), 40);  // small ones gain nothing
  const Selection s = SelectCandidates(hits, 500, {}, kNoNeighbors, {});
  ASSERT_EQ(s.candidates.size(), 1u);
  EXPECT_EQ(s.candidates[0].handle, 1);
}

TEST(SelectCandidates, GathersCovisibleGroups) {
  // A lone hit scores best by itself; the group {1, 2, 3} beats it together and is represented by its best member, 2.
  AdaptiveThresholds thresholds;
  thresholds.k = 0.5;
  thresholds.l = 0.75;
  const std::vector<IndexHit> hits = {
      {0, 100, 500, 0.30f}, {1, 90, 500, 0.10f}, {2, 90, 500, 0.20f}, {3, 90, 500, 0.15f}, {4, 10, 500, 0.50f}};
  std::map<int32_t, std::vector<int32_t>> covisible = {{1, {2, 3, 4}}, {2, {1, 3}}, {3, {2, 1}}};
  const auto neighbors = [&](int32_t handle) { return covisible[handle]; };
  const Selection s = SelectCandidates(hits, 500, thresholds, neighbors, {});
  EXPECT_NEAR(s.best_group_score, 0.45, 1e-6);  // 4 is below k and does not count
  ASSERT_EQ(s.candidates.size(), 1u);           // 0.30 < 0.75 * 0.45
  EXPECT_EQ(s.candidates[0].handle, 2);
  EXPECT_NEAR(s.candidates[0].score, 0.20, 1e-6);
  EXPECT_NEAR(s.candidates[0].group_score, 0.45, 1e-6);

  thresholds.l = 0.6;
  EXPECT_EQ(SelectCandidates(hits, 500, thresholds, neighbors, {}).candidates.size(), 2u);
  SelectionOptions alone;
  alone.max_group_neighbors = 0;
  EXPECT_EQ(SelectCandidates(hits, 500, thresholds, neighbors, alone).candidates[0].handle, 0);
}

TEST(SelectCandidates, TiesKeepTheOrderOfTheHitsAndResultsAreBounded) {
  const std::vector<IndexHit> hits = {{7, 50, 500, 0.1f}, {3, 50, 500, 0.1f}, {5, 50, 500, 0.1f}};
  SelectionOptions options;
  options.max_results = 2;
  const Selection s = SelectCandidates(hits, 500, {}, kNoNeighbors, options);
  ASSERT_EQ(s.candidates.size(), 2u);
  EXPECT_EQ(s.candidates[0].handle, 7);
  EXPECT_EQ(s.candidates[1].handle, 3);
}

TEST(SelectCandidates, ChanceIsNotACandidate) {
  EXPECT_TRUE(SelectCandidates({{0, 4, 500, 0.01f}}, 500, {}, kNoNeighbors, {}).candidates.empty());
  EXPECT_TRUE(SelectCandidates({}, 500, {}, kNoNeighbors, {}).candidates.empty());
}

}  // namespace adaptive_thresholds_test
}  // namespace mapmend
