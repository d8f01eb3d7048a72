#include "libs/connecting/loop_closure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "libs/connecting/loop_connection.h"
#include "libs/geometry/sim3_closed_form.h"
#include "libs/merging/merged_refinement.h"
#include "tests/merger_fixture.h"

namespace mapmend {
namespace loop_closure_test {

using testing::CopyPatch;
using testing::FlightOptions;
using testing::MakeTerrain;
using testing::NadirPose;
using testing::Strip;
using testing::SyntheticFlight;
using testing::Terrain;
using testing::TerrainOptions;
using testing::TerrainPoint;

// A circle and a bit more: the last keyframes stand where the first ones stood.
std::vector<Rigid3> Circle(int count, int per_turn, const Eigen::Vector2d& center = {200, 200}, double radius = 100) {
  std::mt19937_64 random(91);
  std::vector<Rigid3> poses;
  for (int i = 0; i < count; ++i) {
    const double phi = 2 * M_PI * i / per_turn;
    poses.push_back(NadirPose(center.x() + radius * std::sin(phi), center.y() + radius * std::cos(phi), 100,
                              90 + phi * 180 / M_PI, &random));
  }
  return poses;
}

std::vector<Rigid3> SixStrips() {
  std::mt19937_64 random(92);
  std::vector<Rigid3> poses;
  for (int i = 0; i < 6; ++i) {
    const double x0 = i % 2 ? 320 : 80, x1 = i % 2 ? 80 : 320, y = 90 + 25 * i;
    for (const Rigid3& pose : Strip({x0, y}, {x1, y}, 100, 16, i % 2 ? 270 : 90, &random)) poses.push_back(pose);
  }
  return poses;
}

struct Flown {
  Flown(const std::vector<TerrainPoint>& terrain, const std::vector<Rigid3>& poses, const FlightOptions& options)
      : flight("s", 0, terrain, options) {
    flight.AddSubmap(
        poses, {0.03, Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 1, 2).normalized())), {1, 2, 3}});
    session = flight.Model();
  }
  SubmapView View() const { return testing::ViewOf(session, 0); }

  // As the merger finds them: each keyframe asks for the older one that looks most alike among those that are not near.
  // Only for keyframes from first_b on, and only older ones up to last_a.
  std::vector<ConnectedFrames> FindLoops(int first_b = 0, int last_a = 1000, int min_steps = 10) const {
    std::vector<ConnectedFrames> loops;
    const auto& keyframes = View().submap->keyframes;
    for (const auto& [b, query] : keyframes) {
      double best_score = 0;
      KeyframeId best;
      for (const auto& [a, other] : keyframes) {
        if (b.value < first_b || a.value > last_a || b.value - a.value < min_steps) break;
        const double score = BowScore(query.bow, other.bow);
        if (score > best_score) best_score = score, best = a;
      }
      if (!best.IsValid()) continue;
      ConnectedFrames loop = VerifyConnectedFrames(View(), best, View(), b, {});
      if (loop.success) loops.push_back(std::move(loop));
    }
    return loops;
  }

  // RMS distance of the camera centres from the truth after the best similarity, metres.
  double Error(const MergedMap& map) const {
    std::vector<Eigen::Vector3d> estimated, truth;
    for (const MergedKeyframe& k : map.keyframes) {
      estimated.push_back(k.cam_from_root.Center());
      truth.push_back(flight.world_from_keyframe()[k.keyframe->id.value].translation);
    }
    const Similarity3 t = *HornAlignment(estimated, truth);
    double sum = 0;
    for (size_t i = 0; i < truth.size(); ++i) sum += (t * estimated[i] - truth[i]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(truth.size()));
  }
  // By how much a loop is wrong about where its older keyframe lies, seen from the younger one; metres at 100 m
  // altitude.
  double LoopError(const ConnectedFrames& loop) const {
    const SubmapKeyframe &a = View().submap->keyframes.at(loop.keyframe_a),
                         &b = View().submap->keyframes.at(loop.keyframe_b);
    const Eigen::Vector3d estimate = Similarity3(b.cam_from_submap) * loop.b_from_a * a.cam_from_submap.Center() *
                                     (100 / MedianDepth(*View().submap, b));
    const auto& poses = flight.world_from_keyframe();
    return (estimate - poses[loop.keyframe_b.value].Inverse() * poses[loop.keyframe_a.value].translation).norm();
  }

  SyntheticFlight flight;
  Session session;
};

std::vector<RefinementLink> Links(const std::vector<ConnectedFrames>& loops, const LoopJudgement& judgement) {
  std::vector<RefinementLink> links;
  for (size_t i = 0; i < loops.size(); ++i) {
    if (judgement.verdicts[i] != LoopVerdict::kUsed) continue;
    links.push_back({0, 0, loops[i].keyframe_a, loops[i].keyframe_b, loops[i].b_from_a, false});
  }
  return links;
}

FlightOptions Drifting() {
  FlightOptions options;
  options.scale_drift = 0.003;
  options.angle_drift_deg = 0.15;
  return options;
}

TEST(LoopClosure, StraightensASubmapThatDriftHasBent) {
  const Flown flown(Terrain(), Circle(72, 60), Drifting());
  const std::vector<ConnectedFrames> loops = flown.FindLoops();
  const LoopJudgement judgement = JudgeLoops(flown.View(), loops, {});
  ASSERT_TRUE(judgement.is_needed) << judgement.reason;
  EXPECT_GT(judgement.gap_px, 50) << judgement.reason;
  EXPECT_LT(judgement.left_px, 16) << judgement.reason;

  const double as_tracked = flown.Error(MakeMergedMap({flown.View()}, {{}}));
  const MergedRefinementResult with = RefineMergedMap({flown.View()}, {{}}, Links(loops, judgement), {});
  ASSERT_TRUE(with.summary.success) << with.summary.reason;
  const double error = flown.Error(with.map);
  RecordProperty("as_tracked_mm", static_cast<int>(1000 * as_tracked));
  RecordProperty("with_loops_mm", static_cast<int>(1000 * error));
  EXPECT_GT(as_tracked, 2);
  EXPECT_LT(5 * error, as_tracked);
  EXPECT_LT(error, 0.3);
}

TEST(LoopClosure, ClosesWhatBundleAdjustmentAloneLeavesOpen) {
  // 2.2 km with few corners and much noise: the drift is that of the measurements themselves.
  TerrainOptions wide;
  wide.width = wide.height = 1000;
  wide.num_points = 30000;
  const std::vector<TerrainPoint> terrain = MakeTerrain(wide);
  FlightOptions options = Drifting();
  options.scale_drift = 0.002;
  options.angle_drift_deg = 0.05;
  options.max_features = 150;
  options.pixel_noise = 1.5;
  const Flown flown(terrain, Circle(120, 110, {500, 500}, 350), options);
  const std::vector<ConnectedFrames> loops = flown.FindLoops();
  const LoopJudgement judgement = JudgeLoops(flown.View(), loops, {});
  EXPECT_TRUE(judgement.is_needed) << judgement.reason;
  const MergedRefinementResult without = RefineMergedMap({flown.View()}, {{}}, {}, {});
  const MergedRefinementResult with = RefineMergedMap({flown.View()}, {{}}, Links(loops, judgement), {});
  RecordProperty("without_loops_mm", static_cast<int>(1000 * flown.Error(without.map)));
  RecordProperty("with_loops_mm", static_cast<int>(1000 * flown.Error(with.map)));
  EXPECT_LT(4 * flown.Error(with.map), flown.Error(without.map)) << judgement.reason << with.summary.reason;
}

TEST(LoopClosure, LeavesASubmapAloneThatHasNotDrifted) {
  const Flown flown(Terrain(), Circle(72, 60), {});
  const std::vector<ConnectedFrames> loops = flown.FindLoops();
  ASSERT_GT(loops.size(), 5u);
  const LoopJudgement judgement = JudgeLoops(flown.View(), loops, {});
  EXPECT_FALSE(judgement.is_needed) << judgement.reason;
  EXPECT_NE(judgement.reason.find("nothing to gain"), std::string::npos) << judgement.reason;

  Connection connection;
  connection.evidence = loops;
  EstimateLoops(flown.View(), {}, &connection);
  EXPECT_EQ(connection.verdict, Connection::Verdict::kRejected);
  EXPECT_EQ(connection.num_connected_frames, static_cast<int>(loops.size()));
}

TEST(LoopClosure, RefusesALoopThatTrackingCannotHaveMissedByThatMuch) {
  // A straight flight over ground whose texture lies there a second time, 150 m further on.
  std::vector<TerrainPoint> terrain = MakeTerrain({});
  CopyPatch({60, 140}, {240, 140}, 120, &terrain);
  std::mt19937_64 random(93);
  const Flown flown(terrain, Strip({80, 200}, {330, 200}, 100, 26, 90, &random), {});
  const std::vector<ConnectedFrames> loops = flown.FindLoops();
  ASSERT_GE(loops.size(), 2u);  // each of them looks right
  const LoopJudgement judgement = JudgeLoops(flown.View(), loops, {});
  EXPECT_FALSE(judgement.is_needed) << judgement.reason;
  for (const LoopVerdict v : judgement.verdicts) EXPECT_NE(v, LoopVerdict::kUsed);

  Connection connection;
  connection.evidence = loops;
  EstimateLoops(flown.View(), {}, &connection);
  EXPECT_EQ(connection.verdict, Connection::Verdict::kDeactivated);
  EXPECT_NE(connection.reason.find("tracking would be off by"), std::string::npos) << connection.reason;
}

TEST(LoopClosure, RefusesALoopThatContradictsTheOthersAndTheTracking) {
  // Ground of the first strip appears a second time below the last: so far off tracking could be by then.
  std::vector<TerrainPoint> terrain = MakeTerrain({});
  CopyPatch({120, 40}, {140, 165}, 100, &terrain);
  FlightOptions options = Drifting();
  options.max_features = 400;
  const Flown flown(terrain, SixStrips(), options);
  std::vector<ConnectedFrames> loops = flown.FindLoops();
  const std::vector<ConnectedFrames> aliased = flown.FindLoops(80, 15);
  loops.insert(loops.end(), aliased.begin(), aliased.end());
  const LoopJudgement judgement = JudgeLoops(flown.View(), loops, {});
  ASSERT_TRUE(judgement.is_needed) << judgement.reason;
  int num_true = 0, num_contradicted = 0;
  for (size_t i = 0; i < loops.size(); ++i) {
    const bool is_false = flown.LoopError(loops[i]) > 15;
    num_contradicted += is_false && judgement.verdicts[i] == LoopVerdict::kContradicted;
    if (judgement.verdicts[i] == LoopVerdict::kUsed) {
      EXPECT_FALSE(is_false) << flown.LoopError(loops[i]);
      ++num_true;
    }
  }
  EXPECT_GE(num_contradicted, 2);
  EXPECT_GE(num_true, 10);
  const MergedRefinementResult refined = RefineMergedMap({flown.View()}, {{}}, Links(loops, judgement), {});
  ASSERT_TRUE(refined.summary.success) << refined.summary.reason;
  EXPECT_LT(flown.Error(refined.map), 0.3);
}

TEST(LoopClosure, ALoneLoopAsksItsNeighboursAndIsRefusedWithoutThem) {
  const Flown flown(Terrain(), Circle(72, 60), Drifting());
  const std::vector<ConnectedFrames> loops = flown.FindLoops();
  ASSERT_FALSE(loops.empty());
  const size_t strongest =
      static_cast<size_t>(std::max_element(loops.begin(), loops.end(),
                                           [](const auto& l, const auto& r) { return l.num_inliers < r.num_inliers; }) -
                          loops.begin());
  Connection connection;
  connection.evidence = {loops[strongest]};
  EstimateLoops(flown.View(), {}, &connection);
  EXPECT_EQ(connection.verdict, Connection::Verdict::kDeactivated);
  EXPECT_NE(connection.reason.find("neighbouring"), std::string::npos) << connection.reason;

  SeekSupport(
      flown.View(), {},
      [&](KeyframeId a, KeyframeId b) { return VerifyConnectedFrames(flown.View(), a, flown.View(), b, {}); },
      &connection);
  EXPECT_EQ(connection.evidence.size(), 2u);
  EstimateLoops(flown.View(), {}, &connection);
  EXPECT_EQ(connection.verdict, Connection::Verdict::kAccepted) << connection.reason;
  EXPECT_EQ(connection.num_connected_frames, 2);
  EXPECT_GT(connection.num_common_points, 20);
}

}  // namespace loop_closure_test
}  // namespace mapmend
