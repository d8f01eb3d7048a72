#include "libs/retrieval/binary_kmeans.h"

#include <gtest/gtest.h>

#include <set>

namespace mapmend {
namespace binary_kmeans_test {

Descriptor RandomDescriptor(Random* random) { return {random->Next(), random->Next(), random->Next(), random->Next()}; }

Descriptor WithFlippedBits(Descriptor d, int count, Random* random) {
  for (int i = 0; i < count; ++i) {
    const uint64_t bit = random->Next() % 256;
    d[bit / 64] ^= uint64_t{1} << (bit % 64);
  }
  return d;
}

TEST(MajorityDescriptor, TakesEachBitByVote) {
  const std::vector<Descriptor> three = {{0b1100, 0, 0, 1ull << 63}, {0b1010, 7, 0, 1ull << 63}, {0b1001, 7, 0, 0}};
  EXPECT_EQ(MajorityDescriptor(three), (Descriptor{0b1000, 7, 0, 1ull << 63}));
  const std::vector<Descriptor> tie = {{1, 0, 0, 0}, {2, 0, 0, 0}};
  EXPECT_EQ(MajorityDescriptor(tie), Descriptor{});
}

TEST(MajorityDescriptor, AgreesWithPlainCounting) {
  Random random(3);
  std::vector<Descriptor> descriptors;
  for (int i = 0; i < 1001; ++i) descriptors.push_back(RandomDescriptor(&random));
  const Descriptor majority = MajorityDescriptor(descriptors);
  for (int bit = 0; bit < 256; ++bit) {
    int count = 0;
    for (const Descriptor& d : descriptors) count += (d[bit / 64] >> (bit % 64)) & 1;
    EXPECT_EQ((majority[bit / 64] >> (bit % 64)) & 1, count > 500) << bit;
  }
}

TEST(ClusterBinary, FindsWellSeparatedClusters) {
  Random random(5);
  std::vector<Descriptor> truth, descriptors;
  for (int c = 0; c < 6; ++c) truth.push_back(RandomDescriptor(&random));
  for (int i = 0; i < 600; ++i) descriptors.push_back(WithFlippedBits(truth[i % 6], 20, &random));
  const BinaryClusters clusters = ClusterBinary(descriptors, 6, 20, &random);
  ASSERT_EQ(clusters.centers.size(), 6u);
  std::set<int32_t> used;
  for (int i = 0; i < 600; ++i) {
    EXPECT_EQ(clusters.assignment[i], clusters.assignment[i % 6]);
    used.insert(clusters.assignment[i]);
  }
  EXPECT_EQ(used.size(), 6u);
  for (int c = 0; c < 6; ++c) EXPECT_EQ(clusters.centers[clusters.assignment[c]], truth[c]);
}

TEST(ClusterBinary, CopesWithFewDistinctDescriptors) {
  Random random(5);
  const std::vector<Descriptor> two = {{1}, {1}, {2}, {1}, {2}};
  const BinaryClusters clusters = ClusterBinary(two, 10, 10, &random);
  EXPECT_EQ(clusters.centers.size(), 2u);
  EXPECT_EQ(clusters.assignment[0], clusters.assignment[3]);
  EXPECT_NE(clusters.assignment[0], clusters.assignment[2]);
  EXPECT_TRUE(ClusterBinary({}, 10, 10, &random).centers.empty());
}

}  // namespace binary_kmeans_test
}  // namespace mapmend
