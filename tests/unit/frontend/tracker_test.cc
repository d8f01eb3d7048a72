#include "procs/frontend/tracker.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace tracker_test {

// A map of three keyframes side by side, whose poses and points are the true ones.
class TrackerTest : public ::testing::Test {
 protected:
  TrackerTest() {
    for (int i = 0; i < 3; ++i) {
      const Rigid3 pose = NadirPose(0.15 * i, 0);
      const KeyframeIndex index = map_.AddKeyframe(scene_.View(pose, i), pose);
      const std::vector<Eigen::Vector3d> shown = scene_.Shown(i);
      for (FeatureIndex f(0); f < static_cast<int>(shown.size()); ++f) {
        auto [it, is_new] = known_.try_emplace({shown[f].x(), shown[f].y(), shown[f].z()});
        if (is_new) it->second = map_.AddPoint(shown[f], index);
        map_.AddObservation(it->second, index, f);
      }
    }
    for (const auto& [position, point] : known_) map_.RefreshPoint(point);
  }
  int NumFound() const {
    int found = 0;
    for (const WorkingPoint& point : map_.Points()) found += point.found;
    return found;
  }
  // Whether pose and points are what the view with that index truly shows.
  void ExpectTrue(const TrackResult& result, const Rigid3& truth, int index) const {
    ASSERT_TRUE(result.success) << ToString(result.reason);
    EXPECT_LT((result.cam_from_submap.Center() - truth.Center()).norm(), 0.002);
    const std::vector<Eigen::Vector3d> shown = scene_.Shown(index);
    ASSERT_EQ(result.points.size(), shown.size());
    int num_points = 0;
    for (size_t i = 0; i < shown.size(); ++i) {
      if (result.points[i].IsNone()) continue;
      ++num_points;
      EXPECT_EQ(map_.Point(result.points[i]).position, shown[i]);
    }
    EXPECT_EQ(num_points, result.num_inliers);
    EXPECT_GT(num_points, 100);
    EXPECT_GE(result.num_visible, num_points);
  }

  SyntheticScene scene_{3000, -2, 4, 0.1, 3};
  std::map<std::array<double, 3>, PointIndex> known_;  // by position
  IdSource ids_;
  WorkingMap map_{SubmapId(0), {}, &ids_};
  Tracker tracker_{{}, scene_.Camera(), {}};
  const std::vector<KeyframeIndex> hints_ = {KeyframeIndex(1)};
};

TEST_F(TrackerTest, ReturnsPoseAndPointsAroundAPrediction) {
  const Rigid3 truth = NadirPose(0.32, 0.03, 0.02), near = NadirPose(0.31, 0.03, 0.02);
  const auto frame = scene_.View(truth, 3);
  const int found_before = NumFound();
  const TrackResult result = tracker_.Track(near, hints_, *frame, &map_);
  ExpectTrue(result, truth, 3);
  EXPECT_EQ(result.method, TrackMethod::kMotion);
  EXPECT_EQ(result.reference_keyframe, KeyframeIndex(2));
  EXPECT_EQ(NumFound(), found_before + result.num_inliers);
}

TEST_F(TrackerTest, NeedsNoPrediction) {
  const Rigid3 truth = NadirPose(0.02, 0.03, 0.5);
  const auto frame = scene_.View(truth, 3);
  const TrackResult result = tracker_.Track(std::nullopt, hints_, *frame, &map_);
  ExpectTrue(result, truth, 3);
  EXPECT_EQ(result.method, TrackMethod::kDescriptors);
  EXPECT_EQ(result.reference_keyframe, KeyframeIndex(0));
  ExpectTrue(tracker_.TrackAfterwards(hints_, *frame, &map_), truth, 3);
}

TEST_F(TrackerTest, AWrongPredictionDoesNotMislead) {
  const Rigid3 truth = NadirPose(0.1, 0), far = NadirPose(0.1, 0.5);
  const auto frame = scene_.View(truth, 3);
  const TrackResult result = tracker_.Track(far, hints_, *frame, &map_);
  ExpectTrue(result, truth, 3);
  EXPECT_EQ(result.method, TrackMethod::kDescriptors);
}

TEST_F(TrackerTest, OfAnotherPlaceItReturnsNoPointsAndLeavesTheMapAlone) {
  SyntheticScene elsewhere(3000, -2, 4, 0.1, 4);
  const auto frame = elsewhere.View(NadirPose(0, 0), 3);
  const int found_before = NumFound();
  for (const auto& prediction : {std::optional<Rigid3>(), std::optional<Rigid3>(NadirPose(0, 0))}) {
    const TrackResult result = tracker_.Track(prediction, hints_, *frame, &map_);
    EXPECT_FALSE(result.success);
    EXPECT_EQ(result.reason, LossReason::kTooFewMatches);
    EXPECT_EQ(result.method, TrackMethod::kNone);
    EXPECT_TRUE(result.points.empty());
    EXPECT_TRUE(result.reference_keyframe.IsNone());
  }
  EXPECT_EQ(NumFound(), found_before);
}

}  // namespace tracker_test
}  // namespace mapmend
