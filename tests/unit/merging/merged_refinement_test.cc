#include "libs/merging/merged_refinement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>

#include "libs/geometry/sim3_closed_form.h"
#include "tests/merger_fixture.h"

namespace mapmend {
namespace merged_refinement_test {

using testing::FlightOptions;
using testing::NadirPose;
using testing::Strip;
using testing::SyntheticFlight;
using testing::Terrain;

// Two strips there and back, side by side.
std::vector<Rigid3> Survey(const Eigen::Vector2d& from, double length, double spacing, int strips, int per_strip,
                           std::mt19937_64* random) {
  std::vector<Rigid3> poses;
  for (int i = 0; i < strips; ++i) {
    const double x0 = i % 2 ? from.x() + length : from.x(), x1 = i % 2 ? from.x() : from.x() + length;
    const double y = from.y() + i * spacing;
    const auto strip = Strip({x0, y}, {x1, y}, 100, per_strip, i % 2 ? 270 : 90, random);
    poses.insert(poses.end(), strip.begin(), strip.end());
  }
  return poses;
}

// RMS distance of the merged camera centres from the truth after the best similarity, metres.
double CenterError(const MergedMap& map, const std::vector<Rigid3>& world_from_keyframe) {
  std::vector<Eigen::Vector3d> estimated, truth;
  for (const MergedKeyframe& k : map.keyframes) {
    estimated.push_back(k.cam_from_root.Center());
    truth.push_back(world_from_keyframe[k.keyframe->id.value].translation);
  }
  const Similarity3 t = *HornAlignment(estimated, truth);
  double sum = 0;
  for (size_t i = 0; i < truth.size(); ++i) sum += (t * estimated[i] - truth[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

// Two submaps of two strips each that drift, with links as the merger finds them.
struct DriftingSurvey {
  Session session;
  std::vector<Rigid3> world_from_keyframe;
  std::vector<Similarity3> submap_from_world;
  std::vector<SubmapView> views;
  std::vector<RefinementLink> links;
  std::vector<Similarity3> tree;
};

std::unique_ptr<DriftingSurvey> MakeDriftingSurvey() {
  auto survey = std::make_unique<DriftingSurvey>();
  std::mt19937_64 random(21);
  FlightOptions options;
  options.scale_drift = 0.002;
  options.angle_drift_deg = 0.1;
  SyntheticFlight flight("s", 0, Terrain(), options);
  const auto frame = [](double s, double a) {
    return Similarity3(s, Eigen::Quaterniond(Eigen::AngleAxisd(a, Eigen::Vector3d(1, 1, 2).normalized())), {1, 2, 3});
  };
  flight.AddSubmap(Survey({100, 100}, 150, 35, 2, 12, &random), frame(0.01, 0.4));
  flight.AddSubmap(Survey({110, 170}, 150, 35, 2, 12, &random), frame(0.03, -1.4));
  survey->session = flight.Model();
  survey->world_from_keyframe = flight.world_from_keyframe();
  survey->submap_from_world = flight.submap_from_world();
  for (const auto& [id, submap] : survey->session.submaps) {
    survey->views.push_back({&submap, survey->session.info.pinhole, survey->session.info.pyramid});
  }
  for (const auto& [a, b] : std::vector<std::pair<int, int>>{{18, 30}, {14, 34}, {22, 26}}) {
    const ConnectedFrames c =
        VerifyConnectedFrames(survey->views[0], KeyframeId(a), survey->views[1], KeyframeId(b), {});
    EXPECT_TRUE(c.success) << c.reason;
    survey->links.push_back({0, 1, c.keyframe_a, c.keyframe_b, c.b_from_a});
  }
  survey->tree = {Similarity3(), survey->links[0].b_from_a.Inverse()};
  return survey;
}

TEST(MergedRefinement, MendsDriftAndScaleBetweenSubmaps) {
  const auto survey = MakeDriftingSurvey();
  const auto& [session, world_from_keyframe, submap_from_world, views, links, tree] = *survey;
  const double before = CenterError(MakeMergedMap(views, tree), world_from_keyframe);
  const MergedRefinementResult result = RefineMergedMap(views, tree, links, {});
  ASSERT_TRUE(result.summary.success) << result.summary.reason;
  const double after = CenterError(result.map, world_from_keyframe);
  RecordProperty("before_mm", static_cast<int>(1000 * before));
  RecordProperty("after_mm", static_cast<int>(1000 * after));
  EXPECT_GT(before, 1.0);
  EXPECT_LT(after, 0.12) << result.summary.reason;
  EXPECT_LT(result.summary.after.median_px, 1.0);
  EXPECT_GT(result.summary.fusions[0].num_fused, 500);

  // The frame is still that of the root submap, and the single best similarity of the other is near the truth.
  EXPECT_EQ(ToArray(result.root_from_submap[0]), ToArray(Similarity3()));
  const Similarity3 truth = submap_from_world[0] * submap_from_world[1].Inverse();
  EXPECT_NEAR(result.root_from_submap[1].scale / truth.scale, 1, 0.05);

  // Bit-identical the second time.
  const MergedRefinementResult again = RefineMergedMap(views, tree, links, {});
  for (size_t k = 0; k < result.map.keyframes.size(); ++k) {
    EXPECT_EQ(ToArray(result.map.keyframes[k].cam_from_root), ToArray(again.map.keyframes[k].cam_from_root));
  }
}

TEST(MergedRefinement, ALinkPullsByWhatItsEvidenceLeavesOpen) {
  const auto survey = MakeDriftingSurvey();
  const MergedMap map = MakeMergedMap(survey->views, survey->tree);
  const KeyframeRelationOptions options;
  RefinementLink& link = survey->links[1];
  const auto relation = [&] { return RefinementRelations(map, {link}, options).back(); };
  const PoseGraphEdge plain = relation();
  EXPECT_EQ(plain.sigma_rotation, options.verified.rotation);
  EXPECT_EQ(plain.sigma_scale, options.verified.scale);
  link.sigmas = {0.04, 0, 0.3};  // a loose one; but nothing is surer than what was verified
  const PoseGraphEdge loose = relation();
  EXPECT_EQ(loose.sigma_rotation, 0.04);
  EXPECT_EQ(loose.sigma_translation, plain.sigma_translation);
  EXPECT_EQ(loose.sigma_scale, 0.3);
  link.keyframe_b = KeyframeId(99);  // culled since
  EXPECT_EQ(RefinementRelations(map, {link}, options).size(), RefinementRelations(map, {}, options).size());
}

// Positions of every keyframe with noise, a few of them wrong.
FlightPositions PositionsOf(const DriftingSurvey& survey, double noise) {
  FlightPositions positions;
  const LocalFrame frame({47, 8, 400});
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0, noise);
  for (const SubmapView& view : survey.views) {
    for (const auto& [id, keyframe] : view.submap->keyframes) {
      Eigen::Vector3d enu = survey.world_from_keyframe[id.value].translation;
      for (int i = 0; i < 3; ++i) enu[i] += normal(random);
      if (id.value % 11 == 5) enu.x() += 40;
      const Geodetic place = frame.ToGeodetic(enu);
      PositionFix fix;
      fix.utime = keyframe.utime;
      fix.latitude_deg = place.latitude_deg;
      fix.longitude_deg = place.longitude_deg;
      fix.altitude_m = place.altitude_m;
      positions[view.flight].push_back(fix);
    }
  }
  return positions;
}

// Out, across and back, without any overlap that would tell of the drift.
std::unique_ptr<DriftingSurvey> MakeOpenLoop() {
  auto survey = std::make_unique<DriftingSurvey>();
  std::mt19937_64 random(22);
  FlightOptions options;
  options.scale_drift = 0.003;
  options.angle_drift_deg = 0.15;
  options.pixel_noise = 1;
  SyntheticFlight flight("s", 0, Terrain(), options);
  std::vector<Rigid3> poses = Strip({40, 50}, {350, 50}, 100, 26, 90, &random);
  for (const auto& leg :
       {Strip({350, 62}, {350, 338}, 100, 24, 0, &random), Strip({350, 350}, {40, 350}, 100, 26, 270, &random)})
    poses.insert(poses.end(), leg.begin(), leg.end());
  flight.AddSubmap(poses, Similarity3(0.02, Eigen::Quaterniond(0.3, -0.4, 0.5, 0.7).normalized(), {1, 2, 3}));
  survey->session = flight.Model();
  survey->world_from_keyframe = flight.world_from_keyframe();
  for (const auto& [id, submap] : survey->session.submaps)
    survey->views.push_back({&submap, survey->session.info.pinhole, survey->session.info.pyramid});
  return survey;
}

TEST(MergedRefinement, PositionsStraightenWhatNoOverlapDoes) {
  const auto survey = MakeOpenLoop();
  const std::vector<SubmapView>& one = survey->views;
  const MergedRefinementResult without = RefineMergedMap(one, {Similarity3()}, {}, {});
  std::vector<std::string> told;
  const MergedRefinementResult with = RefineMergedMap(
      one, {Similarity3()}, {}, {}, [&](const std::string& what) { told.push_back(what); }, {},
      PositionsOf(*survey, 0.5));
  ASSERT_TRUE(with.summary.success) << with.summary.reason;
  const double error_without = CenterError(without.map, survey->world_from_keyframe),
               error_with = CenterError(with.map, survey->world_from_keyframe);
  RecordProperty("without_mm", static_cast<int>(1000 * error_without));
  RecordProperty("with_mm", static_cast<int>(1000 * error_with));
  EXPECT_LT(error_with, 0.6 * error_without);
  EXPECT_LT(error_with, 0.5);
  EXPECT_LT(with.summary.after.median_px, 1.02 * without.summary.after.median_px);
  EXPECT_TRUE(std::any_of(told.begin(), told.end(), [](const auto& t) { return t.find("have positions") != t.npos; }));
  // The frame is still that of the root submap.
  EXPECT_EQ(ToArray(with.root_from_submap[0]), ToArray(Similarity3()));
  // Switched off they change no bit.
  MergedRefinementOptions off;
  off.positions.use = false;
  const MergedRefinementResult unused =
      RefineMergedMap(one, {Similarity3()}, {}, off, {}, {}, PositionsOf(*survey, 0.3));
  for (size_t k = 0; k < unused.map.keyframes.size(); ++k)
    EXPECT_EQ(ToArray(unused.map.keyframes[k].cam_from_root), ToArray(without.map.keyframes[k].cam_from_root));
}

TEST(MergedRefinement, ALargeMapIsStraightenedByItsOverlapsAndAdjustedAtItsSeams) {
  const auto survey = MakeDriftingSurvey();
  const double before = CenterError(MakeMergedMap(survey->views, survey->tree), survey->world_from_keyframe);
  MergedRefinementOptions options;  // as if 48 keyframes were many
  options.max_keyframes_without_overlaps = 40;
  options.max_keyframes_with_all_points = 40;
  options.max_keyframes_at_once = 40;
  options.windows.window_size = 20;
  std::vector<std::string> told;
  const MergedRefinementResult result = RefineMergedMap(survey->views, survey->tree, survey->links, options,
                                                        [&](const std::string& what) { told.push_back(what); });
  ASSERT_TRUE(result.summary.success) << result.summary.reason;
  EXPECT_EQ(result.summary.bundles.size(), 1u);
  // The overlaps are measured again on the map that they have straightened.
  EXPECT_EQ(std::count_if(told.begin(), told.end(),
                          [](const auto& t) { return t.find("overlaps among them") != std::string::npos; }),
            2);
  EXPECT_GE(std::count_if(told.begin(), told.end(),
                          [](const auto& t) { return t.find("at the seams") != std::string::npos; }),
            2);
  EXPECT_LT(CenterError(result.map, survey->world_from_keyframe), 0.3 * before);
  EXPECT_LT(result.summary.after.median_px, 1.0);
  // The time is bounded by the number of windows.
  options.windows.max_windows = 1;
  told.clear();
  const MergedRefinementResult one = RefineMergedMap(survey->views, survey->tree, survey->links, options,
                                                     [&](const std::string& what) { told.push_back(what); });
  EXPECT_EQ(std::count(told.begin(), told.end(), "a window of 20 keyframes at the seams"), 1);
  EXPECT_LT(one.summary.bundles[0].num_observations, result.summary.bundles[0].num_observations);
}

TEST(MergedMap, NeedsNeitherFeaturesNorObservationsOfItsSubmaps) {
  struct Source : FeatureSource {
    explicit Source(const std::vector<SubmapView>* all) : views(all) {}
    Features Read(int submap, const SubmapKeyframe& keyframe) override {
      return (*views)[submap].submap->keyframes.at(keyframe.id).features;
    }
    const std::vector<SubmapView>* views;
  };
  const auto survey = MakeDriftingSurvey();
  const MergedMap expected = MakeMergedMap(survey->views, survey->tree);
  Session bare = survey->session;
  std::vector<SubmapView> views = survey->views;
  for (size_t s = 0; s < views.size(); ++s) {
    Submap& submap = bare.submaps.at(views[s].submap->id);
    submap.ForgetObservations();
    for (auto& [id, keyframe] : submap.keyframes) keyframe.features = {};
    views[s].submap = &submap;
  }
  EXPECT_THROW(MakeMergedMap(views, survey->tree), std::runtime_error);
  const MergedMap map = MakeMergedMap(views, survey->tree, [&] { return std::make_unique<Source>(&survey->views); });
  ASSERT_EQ(map.points.size(), expected.points.size());
  size_t num_elements = 0;
  for (size_t i = 0; i < map.points.size(); ++i) {
    EXPECT_EQ(map.points[i].position, expected.points[i].position);
    const Submap& submap = *survey->views[map.points[i].first.first].submap;
    const auto& observations = submap.points.at(map.points[i].first.second).observations;
    ASSERT_EQ(map.points[i].track.size(), observations.size());
    for (size_t j = 0; j < observations.size(); ++j) {
      const TrackElement& e = map.points[i].track[j];
      const Keypoint& keypoint =
          submap.keyframes.at(observations[j].keyframe).features.keypoints[observations[j].feature];
      EXPECT_EQ(map.keyframes[e.keyframe].keyframe->id, observations[j].keyframe);
      EXPECT_EQ(e.feature, observations[j].feature);
      EXPECT_EQ(e.octave, keypoint.octave);
      EXPECT_EQ(e.pixel, keypoint.pixel);
      EXPECT_EQ(map.point_of_feature[e.keyframe][e.feature], static_cast<int>(i));
      ++num_elements;
    }
  }
  EXPECT_GT(num_elements, 5000u);
  EXPECT_EQ(map.point_of_feature, expected.point_of_feature);
}

TEST(SearchedKeyframes, AreReadAFewAtATimeAndTheSameIsFound) {
  struct Counts {
    int num_read = 0, num_open = 0;
  };
  struct Source : FeatureSource {
    explicit Source(Counts* c) : counts(c) { ++counts->num_open; }
    ~Source() override { --counts->num_open; }
    Features Read(int, const SubmapKeyframe& keyframe) override {
      EXPECT_EQ(counts->num_open, 1);
      ++counts->num_read;
      return keyframe.features;
    }
    Counts* counts;
  };
  const auto survey = MakeDriftingSurvey();
  MergedMap direct = MakeMergedMap(survey->views, survey->tree), read = direct;
  SearchedKeyframes in_memory(direct);
  const FusionSummary expected = FuseOverlaps(MatchOverlaps(direct, {}, {16}, 0, &in_memory), &direct);
  ASSERT_GT(expected.num_fused, 100);
  const int num_keyframes = static_cast<int>(read.keyframes.size());
  for (const int capacity : {2, num_keyframes}) {
    Counts counts;
    MergedMap map = read;
    SearchedKeyframes searched(
        map, [&] { return std::make_unique<Source>(&counts); }, capacity);
    EXPECT_EQ(FuseOverlaps(MatchOverlaps(map, {}, {16}, 0, &searched), &map).num_fused, expected.num_fused);
    EXPECT_EQ(counts.num_open, 0);
    if (capacity == num_keyframes) {
      EXPECT_LE(counts.num_read, num_keyframes);
    } else {
      EXPECT_GT(counts.num_read, num_keyframes);
    }
    for (size_t i = 0; i < map.points.size(); ++i) ASSERT_EQ(map.points[i].track, direct.points[i].track);
  }
  SearchedKeyframes broken(read, [] {
    struct Empty : FeatureSource {
      Features Read(int, const SubmapKeyframe&) override { return {}; }
    };
    return std::make_unique<Empty>();
  });
  EXPECT_THROW(broken.Get(0), std::runtime_error);
}

TEST(SeamWindows, HoldTheKeyframesThatSeeFusedPointsEachOnce) {
  const auto survey = MakeDriftingSurvey();
  MergedMap map = MakeMergedMap(survey->views, survey->tree);
  EXPECT_TRUE(ChooseSeamWindows(map, {}).empty());  // nothing is fused yet
  SearchedKeyframes searched(map);
  FuseOverlaps(MatchOverlaps(map, {}, {16}, 0, &searched), &map);
  std::set<int> at_seam;
  for (const MergedPoint& p : map.points) {
    for (const TrackElement& e : p.track) {
      if (!p.fused.empty()) at_seam.insert(e.keyframe);
    }
  }
  ASSERT_GT(at_seam.size(), 20u);
  SeamWindowOptions options;
  options.window_size = 8;
  options.max_windows = 100;
  std::set<int> covered;
  for (const std::vector<int>& window : ChooseSeamWindows(map, options)) {
    EXPECT_LE(window.size(), 8u);
    for (const int k : window) EXPECT_TRUE(covered.insert(k).second) << k;
  }
  EXPECT_EQ(covered, at_seam);
}

TEST(MergedMap, FusionKeepsOneFeaturePerKeyframe) {
  std::mt19937_64 random(22);
  SyntheticFlight flight("s", 0, Terrain(), {});
  flight.AddSubmap(Strip({150, 200}, {180, 200}, 100, 4, 0, &random), Similarity3());
  const Session session = flight.Model();
  MergedMap map = MakeMergedMap({{&session.submaps.at(SubmapId(0)), session.info.pinhole, session.info.pyramid}}, {{}});
  // Two points of one keyframe cannot be the same point.
  const int a = map.point_of_feature[1][map.points[0].track[1].feature];
  int b = -1;
  for (const int p : map.point_of_feature[1]) {
    if (p >= 0 && p != a) b = p;
  }
  ASSERT_EQ(a, 0);
  ASSERT_GE(b, 0);
  EXPECT_FALSE(FusePoints(a, b, &map));
  EXPECT_FALSE(map.points[b].track.empty());
}

}  // namespace merged_refinement_test
}  // namespace mapmend
