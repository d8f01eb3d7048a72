#include "libs/connecting/connected_frames.h"

#include <gtest/gtest.h>

#include "tests/merger_fixture.h"

namespace mapmend {
namespace connected_frames_test {

using testing::FlightOptions;
using testing::Frame;
using testing::MakeTerrain;
using testing::Strip;
using testing::SyntheticFlight;
using testing::Terrain;
using testing::TerrainOptions;
using testing::TerrainPoint;
using testing::ViewOf;

// Two submaps of one flight in frames of their own, and the keyframes in their middles verified against each other.
struct Pair {
  Session session;
  Similarity3 truth;  // b_from_a
  ConnectedFrames result;
};

Pair VerifyStrips(const std::vector<Rigid3>& poses_a, const std::vector<Rigid3>& poses_b, double scale_b,
                  const std::vector<TerrainPoint>& terrain = Terrain(), const FlightOptions& options = {}) {
  SyntheticFlight flight("s", 0, terrain, options);
  flight.AddSubmap(poses_a, Frame(0.02, 0.5));
  flight.AddSubmap(poses_b, Frame(0.02 * scale_b, -1.1));
  Pair pair;
  pair.session = flight.Model();
  pair.truth = flight.submap_from_world()[1] * flight.submap_from_world()[0].Inverse();
  const int a = static_cast<int>(poses_a.size() / 2), b = static_cast<int>(poses_a.size() + poses_b.size() / 2);
  pair.result =
      VerifyConnectedFrames(ViewOf(pair.session, 0), KeyframeId(a), ViewOf(pair.session, 1), KeyframeId(b), {});
  return pair;
}

void ExpectNearTruth(const Pair& pair, double viewing_distance) {
  ASSERT_TRUE(pair.result.success) << pair.result.reason;
  const Similarity3& found = pair.result.b_from_a;
  EXPECT_NEAR(found.scale / pair.truth.scale, 1, 0.01) << pair.result.reason;
  EXPECT_LT(RotationAngle(found.rotation * pair.truth.rotation.conjugate()), 0.01);
  // The point under the camera moves to the right place, to 1 % of the viewing distance.
  const Submap& a = pair.session.submaps.at(SubmapId(0));
  const Eigen::Vector3d center = a.keyframes.at(pair.result.keyframe_a).cam_from_submap.Center();
  const double unit = pair.truth.scale * viewing_distance * 0.02;
  EXPECT_LT((found * center - pair.truth * center).norm(), 0.02 * unit) << pair.result.reason;
}

TEST(ConnectedFrames, FoundAtEveryHeading) {
  std::mt19937_64 random(3);
  const auto a = Strip({120, 200}, {220, 200}, 100, 8, 90, &random);
  for (const double heading : {0.0, 90.0, 180.0, 223.0}) {
    SCOPED_TRACE(heading);
    const double h = heading * M_PI / 180;
    const Eigen::Vector2d along(50 * std::sin(h), 50 * std::cos(h)), middle(175, 205);
    ExpectNearTruth(VerifyStrips(a, Strip(middle - along, middle + along, 100, 8, heading, &random), 1.7), 100);
  }
}

TEST(ConnectedFrames, FoundAcrossAScaleRatioOfFour) {
  std::mt19937_64 random(4);
  // A climb: b flies at four times a's altitude; in metres, and so that its own unit is another one too.
  const auto a = Strip({170, 200}, {200, 200}, 40, 8, 90, &random);
  const auto b = Strip({140, 195}, {240, 195}, 160, 8, 90, &random);
  // Only corners of 27 to 35 cm are within reach of the pyramid from both altitudes.
  TerrainOptions terrain;
  terrain.min_size = 0.2;
  terrain.max_size = 0.45;
  terrain.num_points = 20000;
  FlightOptions options;
  options.max_features = 3000;
  ExpectNearTruth(VerifyStrips(a, b, 0.9, MakeTerrain(terrain), options), 40);
}

TEST(ConnectedFrames, FoundWhenOnlyAQuarterOfTheImagesOverlaps) {
  std::mt19937_64 random(5);
  // The ground seen is 128 x 96 m; the strips are 96 m apart sideways.
  const auto a = Strip({120, 150}, {220, 150}, 100, 8, 0, &random);
  const auto b = Strip({120, 222}, {220, 222}, 100, 8, 0, &random);
  ExpectNearTruth(VerifyStrips(a, b, 1.2), 100);
}

TEST(ConnectedFrames, ThreeKeyframesSuffice) {
  std::mt19937_64 random(6);
  ExpectNearTruth(VerifyStrips(Strip({150, 200}, {180, 200}, 100, 3, 0, &random),
                               Strip({160, 210}, {190, 210}, 100, 3, 180, &random), 0.6),
                  100);
}

TEST(ConnectedFrames, DifferentGroundIsRefusedWithAReason) {
  std::mt19937_64 random(7);
  const Pair pair = VerifyStrips(Strip({70, 70}, {120, 70}, 100, 6, 90, &random),
                                 Strip({270, 300}, {320, 300}, 100, 6, 90, &random), 1);
  EXPECT_FALSE(pair.result.success);
  EXPECT_FALSE(pair.result.reason.empty());
}

TEST(ConnectedFrames, AgreementInOneSpotOfTheImageIsNotEnough) {
  // Different ground but for one square of 15 m, an eighth of the image wide, that looks the same: an exact transform
  // fits it.
  TerrainOptions flat;
  flat.relief = 0;
  std::vector<TerrainPoint> terrain = MakeTerrain(flat);
  testing::CopyPatch({113, 193}, {263, 293}, 15, &terrain);
  FlightOptions options;
  options.max_features = 3000;
  options.pixel_noise = 0.2;
  std::mt19937_64 random(9);
  const Pair pair = VerifyStrips(Strip({100, 200}, {140, 200}, 100, 5, 0, &random),
                                 Strip({250, 300}, {290, 300}, 100, 5, 0, &random), 1, terrain, options);
  EXPECT_FALSE(pair.result.success);
  EXPECT_GE(pair.result.num_inliers, ConnectedFramesOptions().min_inliers) << pair.result.reason;
  EXPECT_NE(pair.result.reason.find("of 48 image cells"), std::string::npos) << pair.result.reason;
}

TEST(ConnectedFrames, AnImplausibleScaleIsRefused) {
  std::mt19937_64 random(10);
  const auto a = Strip({150, 200}, {200, 200}, 100, 5, 0, &random),
             b = Strip({150, 210}, {200, 210}, 100, 5, 90, &random);
  EXPECT_TRUE(VerifyStrips(a, b, 7).result.success);
  EXPECT_TRUE(VerifyStrips(a, b, 1 / 7.0).result.success);
  for (const double scale : {9.0, 1 / 9.0}) {
    const Pair pair = VerifyStrips(a, b, scale);
    EXPECT_FALSE(pair.result.success);  // not even a hypothesis of such a scale is heeded
    EXPECT_EQ(pair.result.num_ransac_inliers, 0);
    EXPECT_NE(pair.result.reason.find("agree on one transform"), std::string::npos) << pair.result.reason;
  }
}

TEST(ConnectedFrames, MostOfWhatShouldBeSeenMayNotBeMissing) {
  std::mt19937_64 random(10);
  const Pair pair = VerifyStrips(Strip({150, 200}, {200, 200}, 100, 5, 0, &random),
                                 Strip({150, 210}, {200, 210}, 100, 5, 90, &random), 1);
  ASSERT_TRUE(pair.result.success);
  for (const double share : {0.95, 1.05}) {
    ConnectedFramesOptions options;
    options.min_match_rate = share * pair.result.match_rate;
    const ConnectedFrames frames = VerifyConnectedFrames(ViewOf(pair.session, 0), pair.result.keyframe_a,
                                                         ViewOf(pair.session, 1), pair.result.keyframe_b, options);
    EXPECT_EQ(frames.success, share < 1) << frames.reason;
    EXPECT_EQ(frames.reason.find("should be seen") != std::string::npos, share > 1) << frames.reason;
  }
}

TEST(ConnectedFrames, SameInputSameBits) {
  std::mt19937_64 random(8);
  const auto a = Strip({150, 200}, {200, 200}, 100, 5, 0, &random),
             b = Strip({150, 210}, {200, 210}, 100, 5, 90, &random);
  const Pair first = VerifyStrips(a, b, 2), second = VerifyStrips(a, b, 2);
  EXPECT_EQ(ToArray(first.result.b_from_a), ToArray(second.result.b_from_a));
  EXPECT_EQ(first.result.common_points, second.result.common_points);
}

}  // namespace connected_frames_test
}  // namespace mapmend
