#include "libs/connecting/recognized_share.h"

#include <gtest/gtest.h>

#include "tests/merger_fixture.h"

namespace mapmend {
namespace recognized_share_test {

using testing::CopyPatch;
using testing::Frame;
using testing::MakeTerrain;
using testing::Strip;
using testing::SyntheticFlight;
using testing::TerrainPoint;

// Two submaps connected by every pair of keyframes that holds, as the second pass would find them.
double ShareOf(const std::vector<TerrainPoint>& terrain, const std::vector<Rigid3>& first,
               const std::vector<Rigid3>& second, int max_evidence = 200) {
  SyntheticFlight flight("s", 0, terrain, {});
  flight.AddSubmap(first, Frame(0.02, 0.3));
  flight.AddSubmap(second, Frame(0.05, -0.9));
  flight.End();
  const Session session = flight.Model();
  const SubmapView a{&session.submaps.at(SubmapId(0)), session.info.pinhole, session.info.pyramid};
  const SubmapView b{&session.submaps.at(SubmapId(1)), session.info.pinhole, session.info.pyramid};
  Connection connection;
  for (const auto& [ka, keyframe_a] : a.submap->keyframes) {
    for (const auto& [kb, keyframe_b] : b.submap->keyframes) {
      ConnectedFrames frames = VerifyConnectedFrames(a, ka, b, kb, {});
      if (frames.success) connection.evidence.push_back(std::move(frames));
    }
  }
  EstimateConnection(a, b, {}, &connection);
  EXPECT_EQ(connection.verdict, Connection::Verdict::kAccepted) << connection.reason;
  return RecognizedShare(a, b, connection, max_evidence, {});
}

TEST(RecognizedShare, IsHighWhereTheGroundIsTheSame) {
  std::mt19937_64 random(91);
  const auto first = Strip({80, 100}, {240, 100}, 100, 6, 90, &random);
  EXPECT_GT(ShareOf(testing::Terrain(), first, Strip({80, 120}, {240, 120}, 100, 6, 90, &random)), 0.9);
  EXPECT_GT(ShareOf(testing::Terrain(), first, Strip({180, 60}, {180, 220}, 100, 6, 0, &random)), 0.8);
}

TEST(RecognizedShare, IsLowWhereOnlyAPatchLooksTheSame) {
  std::vector<TerrainPoint> terrain = MakeTerrain({});
  CopyPatch({20, 20}, {20, 250}, 120, &terrain);  // both strips begin there
  std::mt19937_64 random(92);
  const auto first = Strip({80, 80}, {320, 80}, 100, 9, 90, &random);
  const auto second = Strip({80, 310}, {320, 310}, 100, 9, 90, &random);
  EXPECT_LT(ShareOf(terrain, first, second), 0.6);
  EXPECT_EQ(ShareOf(terrain, first, second, 3), 1);  // not all evidence was collected: what is missing says nothing
}

}  // namespace recognized_share_test
}  // namespace mapmend
