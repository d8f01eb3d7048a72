#include <gtest/gtest.h>

#include <cmath>

#include "libs/connecting/loop_closure.h"
#include "tests/merger_fixture.h"

namespace mapmend {
namespace loop_judgement_test {

using testing::FlightOptions;
using testing::MakeTerrain;
using testing::Strip;
using testing::SyntheticFlight;
using testing::Terrain;
using testing::TerrainPoint;
using testing::ViewOf;

// One submap seen from these poses, and two of its keyframes verified against each other.
ConnectedFrames VerifyLoop(const std::vector<TerrainPoint>& terrain, const std::vector<Rigid3>& poses,
                           double scale_drift, int a, int b, Session* session) {
  FlightOptions options;
  options.scale_drift = scale_drift;
  SyntheticFlight flight("s", 0, terrain, options);
  flight.AddSubmap(poses, Similarity3(0.02, Eigen::Quaterniond::Identity(), {1, 2, 3}));
  *session = flight.Model();
  const SubmapView view = ViewOf(*session, 0);
  return VerifyConnectedFrames(view, KeyframeId(a), view, KeyframeId(b), {});
}

LoopJudgement Judge(const Session& session, const ConnectedFrames& loop) {
  return JudgeLoops(ViewOf(session, 0), {loop}, {});
}

TEST(LoopJudgement, ATrueRevisitIsPlausibleInSpiteOfDrift) {
  std::mt19937_64 random(71);
  std::vector<Rigid3> poses = Strip({100, 100}, {260, 100}, 100, 12, 90, &random);
  const auto back = Strip({260, 130}, {100, 130}, 100, 12, 270, &random);
  poses.insert(poses.end(), back.begin(), back.end());
  Session session;
  const ConnectedFrames loop = VerifyLoop(Terrain(), poses, 0.002, 3, 20, &session);
  ASSERT_TRUE(loop.success) << loop.reason;
  EXPECT_GT(std::abs(loop.b_from_a.scale - 1), 0.02);  // it has drifted
  const LoopJudgement judgement = Judge(session, loop);
  EXPECT_EQ(judgement.verdicts[0], LoopVerdict::kAlone) << judgement.reason;  // nothing else speaks against it
}

TEST(LoopJudgement, GroundThatOnlyLooksTheSameIsNot) {
  std::vector<TerrainPoint> terrain = MakeTerrain({});
  testing::CopyPatch({20, 50}, {250, 50}, 120, &terrain);
  std::mt19937_64 random(72);
  Session session;
  const ConnectedFrames loop =
      VerifyLoop(terrain, Strip({80, 110}, {310, 110}, 100, 14, 90, &random), 0, 0, 13, &session);
  ASSERT_TRUE(loop.success) << loop.reason;  // the two images alone do not tell
  const LoopJudgement judgement = Judge(session, loop);
  EXPECT_EQ(judgement.verdicts[0], LoopVerdict::kImplausible) << judgement.reason;
  EXPECT_NE(judgement.reason.find("off by 2."), std::string::npos) << judgement.reason;
}

}  // namespace loop_judgement_test
}  // namespace mapmend
