#include "libs/features/matching.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace mapmend {
namespace matching_test {

Features RandomFeatures(int count, uint32_t seed) {
  std::mt19937_64 rng(seed);
  Features features;
  for (int i = 0; i < count; ++i) {
    Keypoint k;
    k.pixel = {static_cast<float>(rng() % 800), static_cast<float>(rng() % 600)};
    k.angle = static_cast<float>(rng() % 628) / 100;
    features.keypoints.push_back(k);
    features.descriptors.push_back({rng(), rng(), rng(), rng()});
  }
  return features;
}

// The same features turned by an angle, in reverse order, with some bits flipped.
Features Turned(const Features& features, float angle, int flipped_bits, uint32_t seed) {
  std::mt19937_64 rng(seed);
  Features turned;
  for (int i = features.Size() - 1; i >= 0; --i) {
    Keypoint k = features.keypoints[i];
    k.angle = std::fmod(k.angle + angle, static_cast<float>(2 * M_PI));
    Descriptor d = features.descriptors[i];
    for (int b = 0; b < flipped_bits; ++b) d[rng() % 4] ^= uint64_t{1} << (rng() % 64);
    turned.keypoints.push_back(k);
    turned.descriptors.push_back(d);
  }
  return turned;
}

TEST(Matching, BruteForceFindsEveryTrueMatchAmongNoise) {
  const Features a = RandomFeatures(300, 1);
  const Features b = Turned(a, 1.0f, 30, 2);
  const auto matches = MatchBruteForce(a, b, {});
  ASSERT_GT(matches.size(), 290u);
  for (const Match& m : matches) EXPECT_EQ(m.b, 299 - m.a);
}

TEST(Matching, OrientationFilterRemovesTheOddOnesOut) {
  const Features a = RandomFeatures(200, 1);
  Features b = Turned(a, 0.5f, 10, 2);
  b.keypoints[199].angle += 1.5f;  // of feature 0
  const auto matches = MatchBruteForce(a, b, {});
  EXPECT_EQ(std::count_if(matches.begin(), matches.end(), [](const Match& m) { return m.a == 0; }), 0);
  MatchOptions without;
  without.check_orientation = false;
  const auto all = MatchBruteForce(a, b, without);
  EXPECT_EQ(std::count_if(all.begin(), all.end(), [](const Match& m) { return m.a == 0; }), 1);
}

TEST(Matching, ByNodesEqualsBruteForceWhereNodesAgree) {
  const Features a = RandomFeatures(200, 3);
  const Features b = Turned(a, 0.2f, 20, 4);
  std::vector<int32_t> nodes_a(200), nodes_b(200);
  for (int i = 0; i < 200; ++i) nodes_a[i] = nodes_b[199 - i] = i % 7;
  nodes_b[0] = 100;  // feature 199 fell into another node: not found
  const auto matches = MatchByNodes(a, nodes_a, b, nodes_b, {});
  ASSERT_GT(matches.size(), 190u);
  for (const Match& m : matches) {
    EXPECT_EQ(m.b, 199 - m.a);
    EXPECT_NE(m.a, 199);
  }
}

TEST(Matching, RatioRefusesTwins) {
  Features a = RandomFeatures(1, 5), b = a;
  b.keypoints.push_back(b.keypoints[0]);
  b.descriptors.push_back(b.descriptors[0]);
  b.descriptors[1][0] ^= 1;
  a.descriptors[0][1] ^= 0xff;
  EXPECT_TRUE(MatchBruteForce(a, b, {}).empty());
}

TEST(Matching, GridVisitsExactlyWhatLiesNear) {
  const Features f = RandomFeatures(2000, 7);
  const FeatureGrid grid(f.keypoints, 800, 600);
  const Eigen::Vector2f center(123, 456);
  const float radius = 40;
  std::vector<int> seen;
  grid.VisitNear(center, radius, [&](int i) {
    if ((f.keypoints[i].pixel - center).norm() <= radius) seen.push_back(i);
  });
  std::sort(seen.begin(), seen.end());
  std::vector<int> expected;
  for (int i = 0; i < f.Size(); ++i) {
    if ((f.keypoints[i].pixel - center).norm() <= radius) expected.push_back(i);
  }
  EXPECT_EQ(seen, expected);
}

TEST(Matching, FindNearHonoursRadiusOctaveAndUse) {
  Features f = RandomFeatures(3, 9);
  f.keypoints[0].pixel = {100, 100};
  f.keypoints[1].pixel = {110, 100};
  f.keypoints[2].pixel = {300, 300};
  f.keypoints[1].octave = 3;
  const FeatureGrid grid(f.keypoints, 800, 600);
  const std::vector<uint8_t> none(3, 0);
  GuidedSearch search;
  EXPECT_EQ(FindNear(f, grid, {104, 100}, f.descriptors[1], search, none).b, 1);
  search.max_octave = 2;
  EXPECT_EQ(FindNear(f, grid, {104, 100}, f.descriptors[1], search, none).b, -1);
  search.max_octave = 7;
  EXPECT_EQ(FindNear(f, grid, {104, 100}, f.descriptors[2], search, none).b, -1);
  EXPECT_EQ(FindNear(f, grid, {104, 100}, f.descriptors[1], search, {0, 1, 0}).b, -1);
}

// Every feature near the segment is visited, once; far from it few are.
TEST(FeatureGrid, VisitsAlongASegment) {
  std::mt19937_64 rng(5);
  std::uniform_real_distribution<float> x(-20, 820), y(-20, 620);
  std::vector<Keypoint> keypoints(4000);
  for (Keypoint& k : keypoints) k.pixel = {x(rng), y(rng)};
  const FeatureGrid grid(keypoints, 800, 600, 40);
  const float margin = 7;
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Vector2f p0(x(rng), y(rng)),
        p1 = trial % 5 == 0 ? Eigen::Vector2f(x(rng), p0.y()) : Eigen::Vector2f(x(rng), y(rng));
    std::vector<int> visits(keypoints.size(), 0);
    grid.VisitAlong(p0, p1, margin, [&](int i) { ++visits[i]; });
    int num_visited = 0;
    for (size_t i = 0; i < keypoints.size(); ++i) {
      const Eigen::Vector2f d = p1 - p0;
      const float t = std::clamp((keypoints[i].pixel - p0).dot(d) / d.squaredNorm(), 0.0f, 1.0f);
      const float distance = (p0 + t * d - keypoints[i].pixel).norm();
      EXPECT_LE(visits[i], 1);
      if (distance < margin) {
        EXPECT_EQ(visits[i], 1) << trial;
      }
      num_visited += visits[i];
    }
    EXPECT_LT(num_visited, 4000 * ((p1 - p0).norm() + 100) * 200 / (840 * 640));
  }
}

}  // namespace matching_test
}  // namespace mapmend
