#include "procs/frontend/second_opinion.h"

#include <gtest/gtest.h>

#include <array>
#include <map>

#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace second_opinion_test {

constexpr double kStep = 0.08;

// Keyframes of a strip whose map is made as it truly is.
class SecondOpinionTest : public ::testing::Test {
 protected:
  // wrong: it lies elsewhere, and its features observe the points of others.
  void AddKeyframe(bool wrong = false) {
    const int frame = map_.LastKeyframe() + 1;
    const Rigid3 pose = NadirPose(kStep * frame, 0.03 * (frame % 3), 0.02 * frame);
    const Rigid3 told = wrong ? NadirPose(0.5 * kStep * frame, 0, 0.02 * frame) : pose;
    const KeyframeIndex index = map_.AddKeyframe(scene_.View(pose, frame), told);
    const std::vector<Eigen::Vector3d> shown = scene_.Shown(frame);
    for (FeatureIndex i(0); i < static_cast<int>(shown.size()); ++i) {
      const Eigen::Vector3d& shown_here = shown[wrong ? (i + 7) % shown.size() : static_cast<size_t>(i)];
      auto [it, is_new] = points_.try_emplace({shown_here.x(), shown_here.y(), shown_here.z()});
      if (is_new) it->second = map_.AddPoint(shown_here, index);
      map_.AddObservation(it->second, index, i);
    }
    for (const auto& [position, point] : points_) map_.RefreshPoint(point);
  }
  // Largest error of the ways from keyframe to keyframe, as a share of the first.
  double ErrorOfShape() const {
    const auto way = [&](int k) {
      return (map_.Keyframe(KeyframeIndex(k + 1)).cam_from_submap.Center() -
              map_.Keyframe(KeyframeIndex(k)).cam_from_submap.Center())
          .norm();
    };
    const auto true_way = [](int k) { return Eigen::Vector2d(kStep, 0.03 * ((k + 1) % 3) - 0.03 * (k % 3)).norm(); };
    double largest = 0;
    for (int k = 0; k < map_.LastKeyframe(); ++k)
      largest = std::max(largest, std::abs(way(k) / way(0) / (true_way(k) / true_way(0)) - 1));
    return largest;
  }

  SyntheticScene scene_{6000, -1.5, 3, 0.25, 3};
  IdSource ids_;
  WorkingMap map_{SubmapId(0), {}, &ids_};
  std::map<std::array<double, 3>, PointIndex> points_;
  Tracker tracker_{{}, scene_.Camera(), {}};
  LocalMapper mapper_{{}, scene_.Camera(), {}};
  SecondOpinion opinion_{{}, {}, scene_.Camera(), {}, &tracker_, &mapper_};
};

TEST_F(SecondOpinionTest, AMapThatFitsIsLeftAlone) {
  for (int k = 0; k < 16; ++k) {
    AddKeyframe();
    EXPECT_FALSE(opinion_.Seek(&map_)) << k;
  }
  EXPECT_LT(ErrorOfShape(), 1e-9);
}

TEST_F(SecondOpinionTest, AMapThatHasComeToFitBadlyIsReplacedByOneThatFits) {
  for (int k = 0; k < 6; ++k) {
    AddKeyframe();
    ASSERT_FALSE(opinion_.Seek(&map_)) << k;
  }
  for (int k = 6; k < 15; ++k) AddKeyframe(true);
  EXPECT_GT(ErrorOfShape(), 0.3);
  const int num_points = static_cast<int>(map_.Points().size());
  const auto new_of_old = opinion_.Seek(&map_);
  ASSERT_TRUE(new_of_old);
  EXPECT_LT(ErrorOfShape(), 0.05);
  // What takes the place of a point is in the map; all that there was is not.
  ASSERT_EQ(static_cast<int>(new_of_old->size()), num_points);
  int num_kept = 0;
  for (PointIndex p(0); p < num_points; ++p) {
    EXPECT_TRUE(map_.Point(p).removed);
    const PointIndex point = (*new_of_old)[p];
    if (point.IsNone()) continue;
    ++num_kept;
    EXPECT_FALSE(map_.Point(point).removed);
  }
  EXPECT_GT(num_kept, num_points / 3);
  // Asked once more, it is content.
  EXPECT_FALSE(opinion_.Seek(&map_));
}

TEST_F(SecondOpinionTest, AnOldSubmapIsNotAsked) {
  SecondOpinionOptions options;
  options.max_keyframes = 10;
  SecondOpinion opinion(options, {}, scene_.Camera(), {}, &tracker_, &mapper_);
  for (int k = 0; k < 6; ++k) {
    AddKeyframe();
    opinion.Seek(&map_);
  }
  for (int k = 6; k < 15; ++k) AddKeyframe(true);
  EXPECT_FALSE(opinion.Seek(&map_));
}

}  // namespace second_opinion_test
}  // namespace mapmend
