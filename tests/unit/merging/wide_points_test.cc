#include <gtest/gtest.h>

#include <algorithm>

#include "libs/merging/merged_refinement.h"
#include "tests/merger_fixture.h"

namespace mapmend {
namespace wide_points_test {

using testing::FlightOptions;
using testing::NadirPose;
using testing::SyntheticFlight;
using testing::Terrain;

// Two submaps of strips that overlap by half, and what wide features see on both sides, exactly.
class WidePointsTest : public ::testing::Test {
 protected:
  WidePointsTest() : flight_("s", 0, Terrain(), FlightOptions()) {
    flight_.AddSubmap(Line(100), testing::Frame(0.02, 0.4));
    flight_.AddSubmap(Line(160), testing::Frame(0.03, -1.1));
    session_ = flight_.Model();
    for (const int s : {0, 1}) views_.push_back(testing::ViewOf(session_, s));
    const std::vector<Similarity3>& submap_from_world = flight_.submap_from_world();
    b_from_a_ = submap_from_world[1] * submap_from_world[0].Inverse();
    for (size_t i = 0; i < Terrain().size() && common_.in_a.size() < 150; i += 3) AddPoint(Terrain()[i].position);
  }
  static std::vector<Rigid3> Line(double from) {
    std::vector<Rigid3> poses;
    for (int i = 0; i < 8; ++i) poses.push_back(NadirPose(from + 14.0 * i, 150, 100, 90));
    return poses;
  }
  void AddPoint(const Eigen::Vector3d& x) {
    std::vector<WideCommonPoints::Sighting> sightings;
    int of_a = 0, of_b = 0;
    for (int k = 0; k < 16; ++k) {
      const Eigen::Vector3d in_cam = flight_.world_from_keyframe()[k].Inverse() * x;
      const Pinhole& camera = views_[0].camera;
      const Eigen::Vector2d pixel = camera.Project(in_cam);
      if (in_cam.z() < 1 || pixel.x() < 0 || pixel.y() < 0 || pixel.x() > camera.width || pixel.y() > camera.height)
        continue;
      sightings.push_back({k >= 8, KeyframeId(k), pixel.cast<float>(), 1});
      ++(k < 8 ? of_a : of_b);
    }
    if (of_a < 2 || of_b < 2) return;
    common_.in_a.push_back(flight_.submap_from_world()[0] * x);
    common_.sightings.push_back(sightings);
  }
  // Error of the place of the last keyframe of b as seen from the first of a, metres.
  double ErrorAcross(const MergedMap& map) const {
    const auto& truth = flight_.world_from_keyframe();
    const Eigen::Vector3d seen = map.keyframes.front().cam_from_root * map.keyframes.back().cam_from_root.Center();
    const double unit = flight_.submap_from_world()[0].scale;
    return (seen / unit - truth.front().Inverse() * truth[15].translation).norm();
  }

  SyntheticFlight flight_;
  Session session_;
  std::vector<SubmapView> views_;
  Similarity3 b_from_a_;
  WideCommonPoints common_;
};

TEST_F(WidePointsTest, BecomePointsWithTheirSightings) {
  ASSERT_GT(common_.in_a.size(), 100u);
  common_.sightings[1].erase(
      std::remove_if(common_.sightings[1].begin(), common_.sightings[1].end(), [](const auto& s) { return s.is_in_b; }),
      common_.sightings[1].end());                         // only a sees it
  common_.sightings[2].front().keyframe = KeyframeId(99);  // not in the map
  MergedMap map = MakeMergedMap(views_, {Similarity3(), b_from_a_.Inverse()});
  const size_t before = map.points.size();
  AddWidePoints(common_, 0, 1, &map);
  ASSERT_EQ(map.points.size(), before + common_.in_a.size() - 1);
  const MergedPoint& first = map.points[before];
  EXPECT_LT((first.position - common_.in_a[0]).norm(), 1e-9);
  EXPECT_EQ(first.track.size(), common_.sightings[0].size());
  EXPECT_EQ(map.points[before + 1].track.size(), common_.sightings[2].size() - 1);
  EXPECT_FALSE(first.first.second.IsValid());
  EXPECT_TRUE(std::is_sorted(first.track.begin(), first.track.end()));
  for (const TrackElement& e : first.track) EXPECT_LT(map.SquaredError(first, e), 1e-3);
  // One that is taken away leaves the others.
  const TrackElement element = first.track.front();
  const size_t length = first.track.size();
  RemoveFromTrack(static_cast<int>(before), element, &map);
  EXPECT_EQ(map.points[before].track.size(), length - 1);
}

TEST_F(WidePointsTest, HoldTheSeamThatNothingElseHolds) {
  // The link is off by a degree, three per cent of scale and some metres.
  const Similarity3 off(1.03, Eigen::Quaterniond(Eigen::AngleAxisd(0.017, Eigen::Vector3d::UnitZ())),
                        {0.05, -0.04, 0.02});
  const Similarity3 wrong = off * b_from_a_;
  MergedRefinementOptions options;
  options.matching.radius = 0;  // points are not fused
  options.radii = {0.01};
  options.iterations = {30};
  options.shutter.use = false;
  RefinementLink link{0, 1, KeyframeId(5), KeyframeId(10), wrong};
  const std::vector<Similarity3> tree = {Similarity3(), wrong.Inverse()};
  const double without = ErrorAcross(RefineMergedMap(views_, tree, {link}, options).map);
  link.wide = std::make_shared<WideCommonPoints>(common_);
  const MergedRefinementResult result = RefineMergedMap(views_, tree, {link}, options);
  EXPECT_TRUE(result.summary.success) << result.summary.reason;
  EXPECT_GT(without, 2);
  EXPECT_LT(ErrorAcross(result.map), 0.3);
}

}  // namespace wide_points_test
}  // namespace mapmend
