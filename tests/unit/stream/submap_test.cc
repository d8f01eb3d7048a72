#include "libs/stream/submap.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace submap_test {

// A session with one submap of keyframes 0 to 3 (at x = 0 to 3) that see points 0 to 5: keyframe 2 shares four with 1,
// two with 3.
class SubmapTest : public ::testing::Test {
 protected:
  SubmapTest() {
    Apply(SessionStarted{});
    Apply(SubmapStarted{SubmapId(0)});
    for (int k = 0; k < 4; ++k) {
      KeyframeRecord record;
      record.submap = SubmapId(0);
      record.keyframe = KeyframeId(k);
      record.frame = k;
      record.cam_from_submap.translation.x() = -k;
      record.features.keypoints.resize(6);
      record.features.descriptors.resize(6);
      record.features.colors.resize(6);
      record.map_points.resize(6);
      record.words.assign(6, -1);
      record.nodes.assign(6, -1);
      Apply(record);
    }
    MapUpdate update = Update();
    for (int p = 0; p < 6; ++p) {
      update.points.push_back({MapPointId(p), {0, 0, 1}});
      const int last = p < 4 ? 2 : 3;
      for (int k = last - 1; k <= last; ++k) update.observations.push_back({KeyframeId(k), p, MapPointId(p)});
    }
    update.frames.push_back({10, 10, KeyframeId(2), At(0.5)});
    Apply(update);
  }

  static MapUpdate Update() {
    MapUpdate update;
    update.submap = SubmapId(0);
    return update;
  }
  static Rigid3 At(double x) { return Rigid3(Eigen::Matrix3d::Identity(), {-x, 0, 0}); }
  std::string TryApply(RecordBody body) { return session_.Apply({{"test", seq_++, 0}, std::move(body)}); }
  void Apply(RecordBody body) { ASSERT_EQ(TryApply(std::move(body)), ""); }
  const Submap& Map() const { return session_.submaps.begin()->second; }
  double XOfFrame() const { return Map().CamFromSubmap(Map().frames.front()).Center().x(); }

  Session session_;
  int64_t seq_ = 0;
};

TEST_F(SubmapTest, FramesOfACulledKeyframeFollowTheOneThatSharedMostPoints) {
  EXPECT_NEAR(XOfFrame(), 2.5, 1e-12);
  MapUpdate cull = Update();
  cull.removed_keyframes = {KeyframeId(2)};
  Apply(cull);
  EXPECT_NEAR(XOfFrame(), 2.5, 1e-12);
  EXPECT_EQ(Map().Resolved(Map().frames.front()).keyframe, KeyframeId(1));
  EXPECT_EQ(Map().points.at(MapPointId(0)).observations.size(), 1u);
  MapUpdate moved = Update();
  moved.keyframes = {{KeyframeId(1), At(1.25)}, {KeyframeId(3), At(7)}};
  Apply(moved);
  EXPECT_NEAR(XOfFrame(), 2.75, 1e-12);
  // The successor goes too, sharing nothing any more: the one before it takes over.
  MapUpdate further = Update();
  further.removed_keyframes = {KeyframeId(1)};
  Apply(further);
  EXPECT_NEAR(XOfFrame(), 2.75, 1e-12);
  EXPECT_EQ(Map().Resolved(Map().frames.front()).keyframe, KeyframeId(0));
  // A frame that was tracked by a keyframe since removed may still come.
  MapUpdate late = Update();
  late.frames.push_back({11, 11, KeyframeId(1), At(0)});
  Apply(late);
  EXPECT_NEAR(Map().CamFromSubmap(Map().frames.back()).Center().x(), 1.25, 1e-12);
}

TEST_F(SubmapTest, ACulledKeyframeDoesNotComeBackAndTheLastOneStays) {
  MapUpdate all = Update();
  for (int k = 0; k < 4; ++k) all.removed_keyframes.push_back(KeyframeId(k));
  EXPECT_EQ(TryApply(all), "map update: removes the last keyframe");
  EXPECT_EQ(Map().keyframes.size(), 4u);
  MapUpdate cull = Update();
  cull.removed_keyframes = {KeyframeId(2)};
  Apply(cull);
  KeyframeRecord again;
  again.submap = SubmapId(0);
  again.keyframe = KeyframeId(2);
  EXPECT_EQ(TryApply(again), "keyframe: id used before");
}

TEST_F(SubmapTest, WideFeaturesMayFollowTheEndOfTheirSubmap) {
  WideFeaturesRecord wide;
  wide.submap = SubmapId(0);
  wide.keyframe = KeyframeId(2);
  wide.features.keypoints.resize(3);
  wide.features.descriptors.resize(3);
  Apply(wide);
  EXPECT_NE(TryApply(wide), "") << "told before";
  Apply(SubmapEnded{SubmapId(0), "end", "", 3, 0});
  wide.keyframe = KeyframeId(3);
  Apply(wide);
  ASSERT_EQ(Map().wide.size(), 2u);
  EXPECT_EQ(Map().wide.at(KeyframeId(3)).features->Size(), 3);
  EXPECT_LT(Map().wide.at(KeyframeId(2)).seq, Map().wide.at(KeyframeId(3)).seq);
  wide.keyframe = KeyframeId(1);
  wide.features.descriptors.pop_back();
  EXPECT_NE(TryApply(wide).find("disagree"), std::string::npos);
  wide.features.descriptors.resize(3);
  wide.keyframe = KeyframeId();
  EXPECT_NE(TryApply(wide), "") << "neither a keyframe nor a frame";
  wide.frame = 12;
  Apply(wide);
  EXPECT_NE(TryApply(wide), "") << "told before";
  EXPECT_EQ(Map().wide.size(), 2u);
  ASSERT_EQ(Map().wide_between.size(), 1u);
  Submap forgetful = Map();
  forgetful.ForgetWide(wide);
  EXPECT_EQ(forgetful.wide_between.at(12).features, nullptr);
  EXPECT_NE(Map().wide_between.at(12).features, nullptr);
  wide.submap = SubmapId(7);
  EXPECT_NE(TryApply(wide), "");
}

TEST_F(SubmapTest, PositionsBelongToTheSession) {
  PositionFix fix;
  fix.latitude_deg = 50;
  fix.longitude_deg = 8;
  Apply(PositionsRecord{{fix}});
  Apply(SubmapEnded{SubmapId(0), "end_of_input", "", 10, 10});
  Apply(PositionsRecord{{fix, fix}});
  EXPECT_EQ(session_.positions.size(), 3u);
  fix.latitude_deg = 100;
  EXPECT_NE(TryApply(PositionsRecord{{fix}}), "");
  EXPECT_EQ(session_.positions.size(), 3u);
}

TEST_F(SubmapTest, KnowsWhatKeyframesShareWithoutItsObservations) {
  Apply(SubmapEnded{SubmapId(0), "end", "", 3, 0});
  Submap forgetful = Map();
  forgetful.ForgetObservations();
  for (const auto& [id, point] : forgetful.points) {
    EXPECT_EQ(Map().points.at(id).observations.size(), 2u);
    EXPECT_TRUE(point.observations.empty());
  }
  for (const auto& [id, keyframe] : Map().keyframes) {
    const auto known = Map().CountShared(keyframe), kept = forgetful.CountShared(forgetful.keyframes.at(id));
    ASSERT_EQ(known.size(), kept.size());
    for (size_t i = 0; i < known.size(); ++i) {
      EXPECT_EQ(known[i].keyframe, kept[i].keyframe);
      EXPECT_EQ(known[i].num_points, kept[i].num_points);
    }
  }
  const auto shared = forgetful.CountShared(forgetful.keyframes.at(KeyframeId(2)));
  ASSERT_EQ(shared.size(), 2u);
  EXPECT_EQ(shared[0].keyframe, KeyframeId(1));
  EXPECT_EQ(shared[0].num_points, 4);
  EXPECT_EQ(shared[1].keyframe, KeyframeId(3));
  EXPECT_EQ(shared[1].num_points, 2);
  EXPECT_TRUE(forgetful.CountShared(forgetful.keyframes.at(KeyframeId(0))).empty());
}

}  // namespace submap_test
}  // namespace mapmend
