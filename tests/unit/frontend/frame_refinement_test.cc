#include "procs/frontend/frame_refinement.h"

#include <gtest/gtest.h>

#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace frame_refinement_test {

// Two keyframes and a frame between them that sees the points of the first.
class FrameRefinementTest : public ::testing::Test {
 protected:
  FrameRefinementTest() {
    const KeyframeIndex first = map_.AddKeyframe(scene_.View(NadirPose(0, 0), 0), NadirPose(0, 0));
    for (const Eigen::Vector3d& x : scene_.Shown(0)) {
      points_.push_back(map_.AddPoint(x, first));
      map_.AddObservation(points_.back(), first, FeatureIndex(static_cast<int>(points_.size()) - 1));
    }
    for (const PointIndex p : points_) {
      const Eigen::Vector2d pixel = scene_.Camera().Project(Truth() * map_.Point(p).position);
      sightings_.push_back({p, pixel.cast<float>(), 1});
    }
  }
  static Rigid3 Truth() { return NadirPose(0.1, 0.05, 0.1); }
  // Everything moves on, as bundle adjustment does.
  void MovePoints(const Eigen::Vector3d& by) {
    for (const PointIndex p : points_) map_.SetPosition(p, map_.Point(p).position + by);
  }

  SyntheticScene scene_{4000, -1, 1, 0.2, 5};
  IdSource ids_;
  WorkingMap map_{SubmapId(0), {}, &ids_};
  std::vector<PointIndex> points_;
  std::vector<Sighting> sightings_;
  FrameRefinement refinement_{{}, scene_.Camera()};
};

TEST_F(FrameRefinementTest, AFrameFollowsThePointsThatItSaw) {
  const Eigen::Vector3d by(0.02, -0.01, 0.005);
  MovePoints(by);
  const auto pose = refinement_.Refine(Truth(), sightings_, map_);
  ASSERT_TRUE(pose);
  EXPECT_LT((pose->Center() - Truth().Center() - by).norm(), 1e-4);
}

TEST_F(FrameRefinementTest, IsFoundAnewWhereverThePointsAreNow) {
  const Eigen::Vector3d by(3, -7, 2);
  MovePoints(by);
  for (size_t i = 0; i < sightings_.size(); i += 5) sightings_[i].pixel.x() += 60;  // one in five is wrong
  const auto pose = refinement_.FindAnew(sightings_, map_);
  ASSERT_TRUE(pose);
  EXPECT_LT((pose->Center() - Truth().Center() - by).norm(), 1e-3);
}

TEST_F(FrameRefinementTest, KeepsItsPoseIfTooFewPointsAreLeftOrFit) {
  std::vector<Sighting> few(sightings_.begin(), sightings_.begin() + 20);
  EXPECT_FALSE(refinement_.Refine(Truth(), few, map_));
  EXPECT_FALSE(refinement_.FindAnew(few, map_));
  for (size_t i = 0; i < sightings_.size(); i += 2) sightings_[i].pixel.x() += 60;
  EXPECT_FALSE(refinement_.Refine(Truth(), sightings_, map_));
  for (size_t i = 20; i < points_.size(); ++i) map_.RemovePoint(points_[i]);
  EXPECT_FALSE(refinement_.Refine(Truth(), sightings_, map_));
}

TEST_F(FrameRefinementTest, SightingsAreThoseFeaturesThatShowAPoint) {
  const FramePtr frame = scene_.View(NadirPose(0, 0), 1);
  std::vector<PointIndex> points(frame->features.Size());
  points[3] = points_[0];
  const std::vector<Sighting> sightings = SightingsOf(*frame, points, {});
  ASSERT_EQ(sightings.size(), 1u);
  EXPECT_EQ(sightings[0].point, points_[0]);
  EXPECT_EQ(sightings[0].pixel, frame->features.keypoints[3].pixel);
}

}  // namespace frame_refinement_test
}  // namespace mapmend
