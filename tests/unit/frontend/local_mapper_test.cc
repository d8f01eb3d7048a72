#include "procs/frontend/local_mapper.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <vector>

#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace local_mapper_test {

// A map whose keyframes and points lie where they truly are.
class LocalMapperTest : public ::testing::Test {
 protected:
  using Points = std::map<std::array<double, 3>, PointIndex>;  // of a strip, by position

  // A keyframe in which every feature observes the point of `points` that it shows; new ones are added.
  void AddKeyframe(double x, double y, Points* points) {
    const int frame = map_.LastKeyframe() + 1;
    const KeyframeIndex index = map_.AddKeyframe(scene_.View(NadirPose(x, y), frame), NadirPose(x, y));
    const std::vector<Eigen::Vector3d> shown = scene_.Shown(frame);
    for (FeatureIndex i(0); i < static_cast<int>(shown.size()); ++i) {
      auto [it, is_new] = points->try_emplace({shown[i].x(), shown[i].y(), shown[i].z()});
      if (is_new) it->second = map_.AddPoint(shown[i], index);
      map_.AddObservation(it->second, index, i);
      map_.MutablePoint(it->second)->found = map_.MutablePoint(it->second)->visible = 10;
    }
    for (const auto& [position, point] : *points) map_.RefreshPoint(point);
  }
  // A point that the first num_keyframes keyframes see.
  PointIndex SeenByAll(const Points& points, size_t num_keyframes) const {
    for (const auto& [position, point] : points) {
      if (map_.Point(point).observations.size() == num_keyframes) return point;
    }
    return {};
  }

  SyntheticScene scene_{3000, -2, 4, 0.1, 3};
  IdSource ids_;
  WorkingMap map_{SubmapId(0), {}, &ids_};
  LocalMapper mapper_{{}, scene_.Camera(), {}};
};

TEST_F(LocalMapperTest, RecentPointsThatAreSeldomFoundGo) {
  Points points;
  for (int i = 0; i < 3; ++i) AddKeyframe(0.1 * i, 0, &points);
  const PointIndex bad = SeenByAll(points, 3);
  ASSERT_FALSE(bad.IsNone());
  map_.MutablePoint(bad)->found = 1;
  PointIndex good;
  for (const auto& [position, point] : points) {
    if (point != bad && map_.Point(point).observations.size() == 3) good = point;
  }
  ASSERT_FALSE(good.IsNone());
  mapper_.Process(KeyframeIndex(2), &map_);
  EXPECT_TRUE(map_.Point(bad).removed);
  EXPECT_FALSE(map_.Point(good).removed);
}

TEST_F(LocalMapperTest, PointsOfAStripAreFusedWithThoseOfTheStripBeside) {
  Points first, second;
  for (int i = 0; i < 4; ++i) AddKeyframe(0.2 * i, 0, &first);
  for (int i = 0; i < 4; ++i) AddKeyframe(0.6 - 0.2 * i, 0.5, &second);  // the way back
  const KeyframeIndex last = map_.LastKeyframe();
  const auto num_twice = [&] {
    int count = 0;
    for (const PointIndex point : map_.PointsOf(last)) {
      for (const auto& [position, p] : second) {
        const auto it = first.find(position);
        count += p == point && it != first.end() && !map_.Point(it->second).removed;
      }
    }
    return count;
  };
  const int before = num_twice();
  ASSERT_GT(before, 100);
  mapper_.Process(last, &map_);
  EXPECT_LT(num_twice(), before / 5);
}

}  // namespace local_mapper_test
}  // namespace mapmend
