#include "procs/frontend/working_map.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace working_map_test {

FramePtr FrameWithFeatures(int count) {
  auto frame = std::make_shared<Frame>();
  frame->features.keypoints.resize(count);
  frame->features.descriptors.resize(count);
  return frame;
}

Rigid3 Pose() { return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 1)}; }

constexpr KeyframeIndex k0(0), k1(1), k2(2), k3(3);
constexpr FeatureIndex f0(0), f1(1);

TEST(WorkingMap, FusingMovesObservationsAndPublishesTheChange) {
  IdSource ids;
  WorkingMap map(SubmapId(0), {}, &ids);
  for (int i = 0; i < 4; ++i) map.AddKeyframe(FrameWithFeatures(3), Pose());
  const PointIndex a = map.AddPoint({0, 0, 1}, k0), b = map.AddPoint({0, 0, 1.01}, k2);
  map.AddObservation(a, k0, f0);
  map.AddObservation(a, k1, f0);
  map.AddObservation(b, k1, f1);  // a keyframe that sees both: only one observation can stay
  map.AddObservation(b, k2, f1);
  map.AddObservation(b, k3, f1);
  for (KeyframeIndex i(0); i < 4; ++i) map.MarkPublished(i);
  map.TakeUpdate();
  map.FusePoints(b, a);
  EXPECT_TRUE(map.Point(b).removed);
  EXPECT_EQ(map.Point(a).observations.size(), 4u);
  EXPECT_EQ(map.Keyframe(k1).points[f1], PointIndex());
  EXPECT_EQ(map.Keyframe(k3).points[f1], a);
  const MapUpdate update = map.TakeUpdate();
  ASSERT_EQ(update.removed_points.size(), 1u);
  EXPECT_EQ(update.removed_points[0], map.Point(b).id);
  EXPECT_EQ(update.observations.size(), 3u);
  EXPECT_TRUE(map.TakeUpdate().observations.empty());
}

TEST(WorkingMap, APointWithOneObservationLeftIsRemoved) {
  IdSource ids;
  WorkingMap map(SubmapId(0), {}, &ids);
  map.AddKeyframe(FrameWithFeatures(1), Pose());
  map.AddKeyframe(FrameWithFeatures(1), Pose());
  const PointIndex p = map.AddPoint({0, 0, 1}, k0);
  map.AddObservation(p, k0, f0);
  map.AddObservation(p, k1, f0);
  EXPECT_EQ(map.CovisibleKeyframes(k0, 1).size(), 1u);
  map.RemoveObservation(p, k1);
  EXPECT_TRUE(map.Point(p).removed);
  EXPECT_EQ(map.Keyframe(k0).points[f0], PointIndex());
  EXPECT_TRUE(map.CovisibleKeyframes(k0, 1).empty());
  // Never published: the stream need not hear of it.
  EXPECT_TRUE(map.TakeUpdate().removed_points.empty());
}

TEST(WorkingMap, ARemovedKeyframeLeavesItsPointsToTheOthers) {
  IdSource ids;
  WorkingMap map(SubmapId(0), {}, &ids);
  for (int i = 0; i < 3; ++i) map.AddKeyframe(FrameWithFeatures(2), Pose());
  const PointIndex p = map.AddPoint({0, 0, 1}, k0), q = map.AddPoint({0, 0.1, 1}, k0);
  for (KeyframeIndex i(0); i < 3; ++i) map.AddObservation(p, i, f0);
  for (KeyframeIndex i(0); i < 2; ++i) map.AddObservation(q, i, f1);  // one observation will be left
  for (KeyframeIndex i(0); i < 3; ++i) map.MarkPublished(i);
  map.TakeUpdate();
  map.RemoveKeyframe(k1);
  EXPECT_TRUE(map.Keyframe(k1).removed);
  EXPECT_EQ(map.Point(p).observations.size(), 2u);
  EXPECT_TRUE(map.Point(q).removed);
  EXPECT_EQ(map.CovisibleKeyframes(k0, 1).size(), 1u);
  const MapUpdate update = map.TakeUpdate();
  EXPECT_EQ(update.removed_keyframes, std::vector<KeyframeId>{map.Keyframe(k1).id});
  EXPECT_EQ(update.removed_points, std::vector<MapPointId>{map.Point(q).id});
  for (const ObservationChange& o : update.observations) EXPECT_EQ(o.keyframe, map.Keyframe(k0).id);
  EXPECT_TRUE(map.TakeUpdate().removed_keyframes.empty());
}

}  // namespace working_map_test
}  // namespace mapmend
