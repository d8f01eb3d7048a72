#include "procs/viewer_export/connection_matches.h"

#include <gtest/gtest.h>

#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "procs/viewer_export/connection_picture.h"

namespace mapmend {
namespace connection_matches_test {

constexpr int kLandmarks = 60;
constexpr Pinhole kPinhole = {400, 400, 319.5, 239.5, 640, 480};

// Two submaps of one keyframe each that see the same landmarks, in frames that differ by a similarity.
class TwoSubmaps {
 public:
  TwoSubmaps() {
    b_from_a.scale = 0.5;
    b_from_a.rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized());
    b_from_a.translation = {1, -2, 3};
    SessionStarted start;
    start.pinhole = kPinhole;
    start.settings_json = "{}";
    Add(start);
    const Rigid3 moved(Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ())), {0.4, 0.1, 0});
    AddSubmap(0, Rigid3(), Similarity3());
    AddSubmap(1, TransformWorld(moved, b_from_a), b_from_a);
    Add(SessionEnded{2});
  }

  MapModel Model() const {
    MapModel model;
    for (const Record& record : records) EXPECT_EQ(model.Apply(record), "");
    return model;
  }
  FetchKeyframe Fetch() const {
    return [this](const std::string&, int64_t seq) -> std::optional<KeyframeRecord> {
      const auto* keyframe = std::get_if<KeyframeRecord>(&records.at(static_cast<size_t>(seq)).body);
      return keyframe != nullptr ? std::optional(*keyframe) : std::nullopt;
    };
  }
  EvaluatedConnection Connection(bool is_accepted) const {
    EvaluatedConnection connection;
    connection.a = {"s", SubmapId(0)};
    connection.b = {"s", SubmapId(1)};
    if (!is_accepted) return connection;
    connection.verdict = EvaluatedConnection::Verdict::kAccepted;
    connection.b_from_a = b_from_a;
    connection.pairs = {{KeyframeId(0), KeyframeId(1), 50}};
    return connection;
  }
  // Which landmark lies at a pixel of a keyframe; -1: none.
  int LandmarkAt(int keyframe, const Eigen::Vector2f& pixel) const {
    for (int i = 0; i < kLandmarks; ++i) {
      if ((pixels.at(keyframe)[static_cast<size_t>(i)] - pixel).norm() < 1e-3F) return i;
    }
    return -1;
  }

  Similarity3 b_from_a;
  std::vector<Record> records;
  std::map<int, std::vector<Eigen::Vector2f>> pixels;

 private:
  void Add(RecordBody body) {
    const auto seq = static_cast<int64_t>(records.size());
    records.push_back({{"s", seq, 1000 * seq}, std::move(body)});
  }
  void AddSubmap(int number, const Rigid3& cam_from_submap, const Similarity3& submap_from_a) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> where(-1, 1);
    Add(SubmapStarted{SubmapId(number)});
    MapUpdate points;
    points.submap = SubmapId(number);
    KeyframeRecord keyframe;
    keyframe.submap = SubmapId(number);
    keyframe.keyframe = KeyframeId(number);
    keyframe.frame = number;
    keyframe.cam_from_submap = cam_from_submap;
    for (int i = 0; i < kLandmarks; ++i) {
      const Eigen::Vector3d in_a(where(random), 0.8 * where(random), 4 + where(random));
      Descriptor descriptor{};
      for (uint64_t& word : descriptor) word = static_cast<uint64_t>(random()) << 32 | random();
      if (number == 1) descriptor[0] ^= 0x0101010101010101;  // seen again, a little differently
      const MapPointId id(kLandmarks * number + i);
      points.points.push_back({id, (submap_from_a * in_a).cast<float>()});
      const Eigen::Vector2d pixel = kPinhole.Project(cam_from_submap * (submap_from_a * in_a));
      pixels[number].push_back(pixel.cast<float>());
      keyframe.features.keypoints.push_back({pixel.cast<float>(), 0, 0});
      keyframe.features.descriptors.push_back(descriptor);
      keyframe.map_points.push_back(id);
      keyframe.words.push_back(-1);
      keyframe.nodes.push_back(-1);
    }
    Add(points);
    Add(keyframe);
    Add(SubmapEnded{SubmapId(number), "end_of_input", "", number, 1000});
  }
};

TEST(ConnectionMatches, OfAnAcceptedConnectionAreTheSameGround) {
  const TwoSubmaps submaps;
  const MapModel model = submaps.Model();
  const auto matches = MatchConnection(MakeSnapshot(model), submaps.Connection(true), submaps.Fetch());
  ASSERT_TRUE(matches);
  EXPECT_TRUE(matches->are_inliers);
  EXPECT_EQ(matches->a, KeyframeId(0));
  EXPECT_EQ(matches->b, KeyframeId(1));
  EXPECT_GT(matches->matches.size(), kLandmarks * 3u / 4);
  for (const auto& [a, b] : matches->matches) {
    EXPECT_GE(submaps.LandmarkAt(0, a), 0);
    EXPECT_EQ(submaps.LandmarkAt(0, a), submaps.LandmarkAt(1, b));
  }
}

TEST(ConnectionMatches, OfARejectedOneAreWhatLooksAlike) {
  const TwoSubmaps submaps;
  const MapModel model = submaps.Model();
  const auto matches = MatchConnection(MakeSnapshot(model), submaps.Connection(false), submaps.Fetch());
  ASSERT_TRUE(matches);
  EXPECT_FALSE(matches->are_inliers);
  EXPECT_GT(matches->matches.size(), kLandmarks * 3u / 4);
  EXPECT_FALSE(MatchConnection(MakeSnapshot(model), submaps.Connection(false), {}));
}

TEST(ConnectionPicture, ShowsBothImagesAndWhatWasMatched) {
  const TwoSubmaps submaps;
  const MapModel model = submaps.Model();
  const auto fetch = [](const std::string& session, KeyframeId keyframe) -> std::optional<KeyframeImage> {
    if (keyframe != KeyframeId(0)) return std::nullopt;
    KeyframeImage image;
    image.session = session;
    image.keyframe = keyframe;
    cv::imencode(".png", cv::Mat(480, 640, CV_8UC3, cv::Scalar(200, 30, 30)), image.bytes);
    return image;
  };
  const std::vector<uint8_t> bytes =
      DrawConnection(MakeSnapshot(model), submaps.Connection(true), {fetch, submaps.Fetch()}, {240, "png"});
  const cv::Mat picture = cv::imdecode(bytes, cv::IMREAD_COLOR);
  ASSERT_EQ(picture.rows, 270);
  ASSERT_EQ(picture.cols, 2 * 320 + 6);
  EXPECT_EQ(picture.at<cv::Vec3b>(265, 5), cv::Vec3b(200, 30, 30)) << "the image on the left";
  EXPECT_EQ(picture.at<cv::Vec3b>(265, 640), cv::Vec3b(200, 200, 200)) << "none on the right";
  int num_green = 0;
  for (int y = 30; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) num_green += picture.at<cv::Vec3b>(y, x)[1] > 210;
  }
  EXPECT_GT(num_green, 1000);
}

}  // namespace connection_matches_test
}  // namespace mapmend
