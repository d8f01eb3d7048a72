#include "libs/retrieval/inverted_index.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace mapmend {
namespace inverted_index_test {

BowVector Bow(std::vector<int32_t> words) {
  BowVector bow;
  bow.weights.assign(words.size(), 1.0f / static_cast<float>(words.size()));
  bow.words = std::move(words);
  return bow;
}

BowVector RandomBow(std::mt19937* rng, int num_words, int vocabulary) {
  std::vector<int32_t> words;
  for (int i = 0; i < num_words; ++i) words.push_back(static_cast<int32_t>((*rng)() % vocabulary));
  std::sort(words.begin(), words.end());
  words.erase(std::unique(words.begin(), words.end()), words.end());
  BowVector bow = Bow(words);
  float sum = 0;
  for (float& w : bow.weights) sum += w = static_cast<float>((*rng)() % 1000 + 1);
  for (float& w : bow.weights) w /= sum;
  return bow;
}

TEST(InvertedIndex, CountsCommonWordsAndScores) {
  InvertedIndex index;
  index.Add(Bow({1, 5, 9, 20}), {0, 0, 0, 1});
  index.Add(Bow({2, 3}), {0, 0, 1, 2});
  index.Add(Bow({5, 20}), {0, 1, 2, 3});
  const auto hits = index.Query(Bow({5, 9, 20, 1000}), {.last_seq = {10}});
  ASSERT_EQ(hits.size(), 2u);
  EXPECT_EQ(hits[0].handle, 0);
  EXPECT_EQ(hits[0].common_words, 3);
  EXPECT_EQ(hits[0].num_words, 4);
  EXPECT_FLOAT_EQ(hits[0].score, 0.75f);
  EXPECT_EQ(hits[1].handle, 2);
  EXPECT_EQ(hits[1].common_words, 2);
  EXPECT_FLOAT_EQ(hits[1].score, 0.5f);  // min(1/4, 1/2) twice
}

TEST(InvertedIndex, AgreesWithPairwiseScores) {
  std::mt19937 rng(3);
  InvertedIndex index;
  std::vector<BowVector> bows;
  for (int i = 0; i < 60; ++i) {
    bows.push_back(RandomBow(&rng, 200, 3000));
    index.Add(bows.back(), {0, 0, i, i});
  }
  const BowVector query = RandomBow(&rng, 300, 3000);
  const auto hits = index.Query(query, {.last_seq = {100}});
  EXPECT_EQ(hits.size(), 60u);
  for (const IndexHit& hit : hits) {
    EXPECT_EQ(hit.common_words, CountCommonWords(query, bows[hit.handle]));
    EXPECT_NEAR(hit.score, BowScore(query, bows[hit.handle]), 1e-6);
  }
}

// Leaving out early what shares too little must not change the answer: hits beyond the ratio, of the same bits.
TEST(InvertedIndex, ARatioLeavesOutExactlyWhatLiesBelowIt) {
  std::mt19937 rng(7);
  InvertedIndex index;
  for (int i = 0; i < 300; ++i) {
    index.Add(RandomBow(&rng, 50 + static_cast<int>(rng() % 400), 800), {i % 3, i / 50, i, i});
  }
  for (int i = 0; i < 300; i += 9) index.Remove(i, 200);
  const IndexScope scope = {.last_seq = {250, 280, 240},
                            .session_rank = {2, 0, 1},
                            .excluded_session = 1,
                            .excluded_submap = 2,
                            .excluded_handles = {4, 5, 6}};
  for (int i = 0; i < 20; ++i) {
    const BowVector query = RandomBow(&rng, 50 + static_cast<int>(rng() % 400), 800);
    const auto all = index.Query(query, scope);
    ASSERT_GT(all.size(), 100u);
    const auto normalized = [&](const IndexHit& hit) {
      return NormalizedCommonWords(hit.common_words, hit.num_words, query.Size());
    };
    double most = 0;
    for (const IndexHit& hit : all) most = std::max(most, normalized(hit));
    for (const double ratio : {0.3, 0.6, 0.8, 1.0}) {
      std::vector<IndexHit> expected;
      for (const IndexHit& hit : all) {
        if (normalized(hit) >= ratio * most) expected.push_back(hit);
      }
      const auto hits = index.Query(query, scope, ratio);
      ASSERT_EQ(hits.size(), expected.size());
      for (size_t k = 0; k < hits.size(); ++k) {
        EXPECT_EQ(hits[k].handle, expected[k].handle);
        EXPECT_EQ(hits[k].common_words, expected[k].common_words);
        EXPECT_EQ(hits[k].score, expected[k].score);
      }
    }
  }
}

TEST(InvertedIndex, FindsKeyframesHoweverManyThereAre) {
  constexpr int kMany = 20000;
  std::mt19937 rng(11);
  InvertedIndex index;
  std::vector<BowVector> bows;
  for (int i = 0; i < kMany; ++i) {
    bows.push_back(RandomBow(&rng, 4, 40));
    index.Add(bows.back(), {0, 0, i, i});
  }
  const BowVector query = RandomBow(&rng, 8, 40);
  const auto hits = index.Query(query, {.last_seq = {kMany}});
  size_t at = 0;
  for (int i = 0; i < kMany; ++i) {
    const int common_words = CountCommonWords(query, bows[i]);
    if (common_words == 0) continue;
    ASSERT_LT(at, hits.size());
    ASSERT_EQ(hits[at].handle, i);
    ASSERT_EQ(hits[at].common_words, common_words);
    ASSERT_NEAR(hits[at++].score, BowScore(query, bows[i]), 1e-6);
  }
  EXPECT_EQ(at, hits.size());
  EXPECT_GT(index.Bytes(), 0);
}

TEST(InvertedIndex, AnswersAsOfARecord) {
  InvertedIndex index;
  index.Add(Bow({1}), {0, 0, 0, 2});
  const int32_t culled = index.Add(Bow({1}), {0, 0, 1, 4});
  index.Add(Bow({1}), {0, 1, 2, 6});
  index.Add(Bow({1}), {1, 0, 0, 3});
  index.Remove(culled, 5);
  const auto keyframes = [&](const IndexScope& scope) {
    std::vector<int32_t> handles;
    for (const IndexHit& hit : index.Query(Bow({1}), scope)) handles.push_back(hit.handle);
    return handles;
  };
  using Handles = std::vector<int32_t>;
  EXPECT_EQ(keyframes({.last_seq = {1, -1}}), Handles());
  EXPECT_EQ(keyframes({.last_seq = {2, -1}}), Handles({0}));
  EXPECT_EQ(keyframes({.last_seq = {4, -1}}), Handles({0, 1}));
  EXPECT_EQ(keyframes({.last_seq = {5, -1}}), Handles({0}));
  EXPECT_EQ(keyframes({.last_seq = {6}}), Handles({0, 2}));  // session 1 is not named
  EXPECT_EQ(keyframes({.last_seq = {6, 3}}), Handles({0, 2, 3}));
  EXPECT_EQ(keyframes({.last_seq = {6, 3}, .excluded_session = 0, .excluded_submap = 0}), Handles({2, 3}));
  EXPECT_EQ(keyframes({.last_seq = {6, 3}, .excluded_handles = {3, 0}}), Handles({2}));
  EXPECT_EQ(keyframes({.last_seq = {6, 3}, .session_rank = {1, 0}}), Handles({3, 0, 2}));
}

TEST(InvertedIndex, DoesNotDependOnTheOrderOfAdding) {
  std::mt19937 rng(5);
  std::vector<BowVector> bows;
  for (int i = 0; i < 40; ++i) bows.push_back(RandomBow(&rng, 100, 300));
  InvertedIndex forward, backward;
  for (int i = 0; i < 40; ++i) forward.Add(bows[i], {0, 0, i, i});
  for (int i = 39; i >= 0; --i) backward.Add(bows[i], {0, 0, i, i});
  const BowVector query = RandomBow(&rng, 100, 300);
  const auto a = forward.Query(query, {.last_seq = {99}}), b = backward.Query(query, {.last_seq = {99}});
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(forward.Entry(a[i].handle).keyframe, backward.Entry(b[i].handle).keyframe);
    EXPECT_EQ(a[i].score, b[i].score);
  }
}

TEST(InvertedIndex, RefusesBadVectorsUnchanged) {
  InvertedIndex index;
  index.Add(Bow({1, 2}), {});
  EXPECT_THROW(index.Add(Bow({3, 3}), {}), std::invalid_argument);
  EXPECT_THROW(index.Add(Bow({-1, 3}), {}), std::invalid_argument);
  EXPECT_THROW(index.Add(Bow({1, InvertedIndex::kMaxWords}), {}), std::invalid_argument);
  EXPECT_THROW(index.Add(Bow({1}), {.session = -1}), std::invalid_argument);
  EXPECT_THROW(index.Query(Bow({4, 2}), {.last_seq = {9}}), std::invalid_argument);
  BowVector uneven = Bow({1, 2});
  uneven.weights.pop_back();
  EXPECT_THROW(index.Add(uneven, {}), std::invalid_argument);
  EXPECT_EQ(index.Size(), 1);
  EXPECT_EQ(index.Query(Bow({3}), {.last_seq = {9}}).size(), 0u);
}

}  // namespace inverted_index_test
}  // namespace mapmend
