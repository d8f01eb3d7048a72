#include "procs/merger/loop_consistency.h"

#include <gtest/gtest.h>

#include "tests/unit/merger/synthetic_flight.h"

namespace mapmend {
namespace {

using testing::FlightOptions;
using testing::MakeTerrain;
using testing::Strip;
using testing::SyntheticFlight;
using testing::TerrainPoint;

// One submap seen from these poses, and two of its keyframes verified against each other.
ConnectedFrames VerifyLoop(const std::vector<TerrainPoint>& terrain, const std::vector<Rigid3>& poses, double scale_drift, int a,
                           int b, Session* session) {
  FlightOptions options;
  options.scale_drift = scale_drift;
  SyntheticFlight flight("s", 0, terrain, options);
  flight.AddSubmap(poses, Similarity3(0.02, Eigen::Quaterniond::Identity(), {1, 2, 3}));
  *session = flight.Model();
  const SubmapView view{&session->submaps.at(SubmapId(0)), session->info.pinhole, session->info.pyramid};
  return VerifyConnectedFrames(view, KeyframeId(a), view, KeyframeId(b), {});
}

TEST(LoopConsistency, ATrueRevisitIsPlausibleInSpiteOfDrift) {
  std::mt19937_64 random(71);
  std::vector<Rigid3> poses = Strip({100, 100}, {260, 100}, 100, 12, 90, &random);
  const auto back = Strip({260, 130}, {100, 130}, 100, 12, 270, &random);
  poses.insert(poses.end(), back.begin(), back.end());
  Session session;
  const ConnectedFrames loop = VerifyLoop(MakeTerrain({}), poses, 0.002, 3, 20, &session);
  ASSERT_TRUE(loop.success) << loop.reason;
  const LoopJudgement judgement = JudgeLoop(session.submaps.at(SubmapId(0)), loop, {});
  EXPECT_GT(judgement.displacement, 0.005);  // it has drifted
  EXPECT_TRUE(judgement.plausible) << judgement.displacement << " of " << judgement.allowed;
}

TEST(LoopConsistency, GroundThatOnlyLooksTheSameIsNot) {
  std::vector<TerrainPoint> terrain = MakeTerrain({});
  testing::CopyPatch({20, 50}, {250, 50}, 120, &terrain);
  std::mt19937_64 random(72);
  Session session;
  const ConnectedFrames loop = VerifyLoop(terrain, Strip({80, 110}, {310, 110}, 100, 14, 90, &random), 0, 0, 13, &session);
  ASSERT_TRUE(loop.success) << loop.reason;  // the two images alone do not tell
  const LoopJudgement judgement = JudgeLoop(session.submaps.at(SubmapId(0)), loop, {});
  EXPECT_NEAR(judgement.displacement, 2.3, 0.2);
  EXPECT_FALSE(judgement.plausible) << judgement.displacement << " of " << judgement.allowed;
}

}  // namespace
}  // namespace mapmend
