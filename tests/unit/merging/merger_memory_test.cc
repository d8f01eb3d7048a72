#include <gtest/gtest.h>
#include <malloc.h>

#include <string>
#include <vector>

#include "libs/merging/merger.h"
#include "tests/merger_fixture.h"
#include "tests/synthetic_flight.h"

// What keyframes beyond the cache take. That the map does not depend on what is held is told in
// merger_determinism_test.cc.
namespace mapmend {
namespace merger_memory_test {

using testing::Strip;
using testing::SyntheticFlight;
using testing::Terrain;

struct NoProposals : BowSource {
  std::vector<BowProposal> Query(const BowQuestion&) override { return {}; }
};

struct Deaf : MergerOutput {
  void OnConnection(const Connection&) override {}
  void OnTransforms(const MergedTransforms&) override {}
  void OnRevision(const MergedTransforms&, const std::vector<Connection>&, const std::vector<RefinedSubmap>&) override {
  }
  void OnProgress(const std::string&) override {}
};

struct RecordSource : KeyframeSource {
  explicit RecordSource(const std::vector<Record>& all) : records(all) {}
  KeyframeRecord Read(const std::string&, int64_t seq) override {
    return std::get<KeyframeRecord>(records.at(seq).body);
  }
  const std::vector<Record>& records;
};

// Strips beside each other, a submap each.
SyntheticFlight ManyStrips(int num_strips, int per_strip) {
  std::mt19937_64 random(8);
  SyntheticFlight flight("s", 0, Terrain(), {});
  for (int s = 0; s < num_strips; ++s) {
    const double y = 80 + 20.0 * s;
    flight.AddSubmap(Strip({80, y}, {320, y}, 100, per_strip, 90, &random), Similarity3(0.02, {1, 0, 0, 0}, {1, 2, 3}));
  }
  flight.End();
  return flight;
}

TEST(MergerMemory, AKeyframeBeyondTheCacheTakesLessThanItsKeypoints) {
  constexpr int kNumStrips = 10, kPerStrip = 15;
  const SyntheticFlight flight = ManyStrips(kNumStrips, kPerStrip);
  NoProposals no_proposals;
  RecordSource source(flight.records());
  Deaf out;
  MergerOptions options;
  options.search.max_cached_keyframes = 2 * kPerStrip;
  options.search.neighbors.num_submaps = 0;  // connections take memory of their own
  Merger merger(options, &no_proposals, &out, &source);
  const auto num_keyframes = [&] {
    size_t n = 0;
    for (const auto& [id, submap] : merger.sessions().begin()->second.submaps) n += submap.keyframes.size();
    return n;
  };
  size_t bytes_before = 0, keyframes_before = 0, features = 0;
  for (const Record& record : flight.records()) {
    ASSERT_EQ(merger.Consume(record), "");
    if (keyframes_before > 0) {
      const auto* keyframe = std::get_if<KeyframeRecord>(&record.body);
      features += keyframe ? keyframe->map_points.size() : 0;
    } else if (std::holds_alternative<SubmapEnded>(record.body) && num_keyframes() > 2 * kPerStrip) {
      bytes_before = mallinfo2().uordblks;
      keyframes_before = num_keyframes();
    }
  }
  const double grown = static_cast<double>(mallinfo2().uordblks - bytes_before);
  const double num_added = static_cast<double>(num_keyframes() - keyframes_before);
  ASSERT_EQ(num_added, (kNumStrips - 3) * kPerStrip);
  const double keypoints = static_cast<double>(features * sizeof(Keypoint));
  EXPECT_GT(keypoints / num_added, 5000);
  RecordProperty("bytes_a_keyframe", static_cast<int>(grown / num_added));
  EXPECT_GT(grown, 0);
  EXPECT_LT(grown, keypoints) << grown / num_added << " bytes a keyframe";
}

}  // namespace merger_memory_test
}  // namespace mapmend
