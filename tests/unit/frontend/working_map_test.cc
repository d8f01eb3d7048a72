#include "procs/frontend/working_map.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace {

FramePtr FrameWithFeatures(int count) {
  auto frame = std::make_shared<Frame>();
  frame->features.keypoints.resize(count);
  frame->features.descriptors.resize(count);
  frame->points.assign(count, -1);
  frame->cam_from_submap.translation.z() = 1;
  return frame;
}

TEST(WorkingMap, FusingMovesObservationsAndPublishesTheChange) {
  IdSource ids;
  WorkingMap map(SubmapId(0), {}, &ids);
  for (int i = 0; i < 4; ++i) map.AddKeyframe(FrameWithFeatures(3));
  const int a = map.AddPoint({0, 0, 1}, 0), b = map.AddPoint({0, 0, 1.01}, 2);
  map.AddObservation(a, 0, 0);
  map.AddObservation(a, 1, 0);
  map.AddObservation(b, 1, 1);  // a keyframe that sees both: only one observation can stay
  map.AddObservation(b, 2, 1);
  map.AddObservation(b, 3, 1);
  for (int i = 0; i < 4; ++i) map.MarkPublished(i);
  map.TakeUpdate();
  map.FusePoints(b, a);
  EXPECT_TRUE(map.Point(b).removed);
  EXPECT_EQ(map.Point(a).observations.size(), 4u);
  EXPECT_EQ(map.Keyframe(1).frame->points[1], -1);
  EXPECT_EQ(map.Keyframe(3).frame->points[1], a);
  const MapUpdate update = map.TakeUpdate();
  ASSERT_EQ(update.removed_points.size(), 1u);
  EXPECT_EQ(update.removed_points[0], map.Point(b).id);
  EXPECT_EQ(update.observations.size(), 3u);
  EXPECT_TRUE(map.TakeUpdate().observations.empty());
}

TEST(WorkingMap, APointWithOneObservationLeftIsRemoved) {
  IdSource ids;
  WorkingMap map(SubmapId(0), {}, &ids);
  map.AddKeyframe(FrameWithFeatures(1));
  map.AddKeyframe(FrameWithFeatures(1));
  const int p = map.AddPoint({0, 0, 1}, 0);
  map.AddObservation(p, 0, 0);
  map.AddObservation(p, 1, 0);
  EXPECT_EQ(map.CovisibleKeyframes(0, 1).size(), 1u);
  map.RemoveObservation(p, 1);
  EXPECT_TRUE(map.Point(p).removed);
  EXPECT_EQ(map.Keyframe(0).frame->points[0], -1);
  EXPECT_TRUE(map.CovisibleKeyframes(0, 1).empty());
  // Never published: the stream need not hear of it.
  EXPECT_TRUE(map.TakeUpdate().removed_points.empty());
}

TEST(WorkingMap, ARemovedKeyframeLeavesItsPointsToTheOthers) {
  IdSource ids;
  WorkingMap map(SubmapId(0), {}, &ids);
  for (int i = 0; i < 3; ++i) map.AddKeyframe(FrameWithFeatures(2));
  const int p = map.AddPoint({0, 0, 1}, 0), q = map.AddPoint({0, 0.1, 1}, 0);
  for (int i = 0; i < 3; ++i) map.AddObservation(p, i, 0);
  for (int i = 0; i < 2; ++i) map.AddObservation(q, i, 1);  // one observation will be left
  for (int i = 0; i < 3; ++i) map.MarkPublished(i);
  map.TakeUpdate();
  map.RemoveKeyframe(1);
  EXPECT_TRUE(map.Keyframe(1).removed);
  EXPECT_EQ(map.Point(p).observations.size(), 2u);
  EXPECT_TRUE(map.Point(q).removed);
  EXPECT_EQ(map.CovisibleKeyframes(0, 1).size(), 1u);
  const MapUpdate update = map.TakeUpdate();
  EXPECT_EQ(update.removed_keyframes, std::vector<KeyframeId>{map.Keyframe(1).id});
  EXPECT_EQ(update.removed_points, std::vector<MapPointId>{map.Point(q).id});
  for (const ObservationChange& o : update.observations) EXPECT_EQ(o.keyframe, map.Keyframe(0).id);
  EXPECT_TRUE(map.TakeUpdate().removed_keyframes.empty());
}

}  // namespace
}  // namespace mapmend
