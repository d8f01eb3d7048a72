#include "libs/features/orb_extractor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

namespace mapmend {
namespace orb_extractor_test {

// A frame of the bundled flight, 800x600.
cv::Mat FlightImage() {
  static const cv::Mat grey = [] {
    cv::VideoCapture video(MAPMEND_SOURCE_DIR "/data/flights/sheffield_cross/video.mp4");
    cv::Mat frame, result;
    video.read(frame);
    cv::cvtColor(frame, result, cv::COLOR_BGR2GRAY);
    return result;
  }();
  return grey.clone();
}

cv::Mat NoiseImage(int width, int height) {
  cv::Mat image(height, width, CV_8UC1);
  cv::RNG rng(7);
  rng.fill(image, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(image, image, cv::Size(0, 0), 1.5);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

OrbExtractor Extractor(int num_features) {
  OrbOptions options;
  options.num_features = num_features;
  return OrbExtractor(options);
}

Descriptor FromRow(const cv::Mat& row) {
  Descriptor d;
  std::memcpy(d.data(), row.data, 32);
  return d;
}

struct WarpResult {
  double repeatability;  // keypoints with one at the warped place and scale
  double match_rate;     // of those, nearest descriptor among all is the right one
  double median_error;   // pixels, of right matches at octave 0
};

// Extracts from the image and from its warp by homography H (pixel of image to pixel of warp).
WarpResult MeasureWarp(const cv::Mat& image, const cv::Matx33d& H, double scale_change, double rotation) {
  cv::Mat warped;
  cv::warpPerspective(image, warped, H, image.size(), cv::INTER_LINEAR, cv::BORDER_REFLECT_101);
  const OrbExtractor extractor = Extractor(1000);
  const RawFeatures a = extractor.Extract(image), b = extractor.Extract(warped);
  const double octave_change = std::log(scale_change) / std::log(1.2);
  int visible = 0, repeated = 0, matched = 0;
  std::vector<double> errors;
  for (int i = 0; i < a.Size(); ++i) {
    const cv::Vec3d p = H * cv::Vec3d(a.keypoints[i].pixel.x(), a.keypoints[i].pixel.y(), 1);
    const Eigen::Vector2f at(p[0] / p[2], p[1] / p[2]);
    if (at.x() < 60 || at.y() < 60 || at.x() > image.cols - 60 || at.y() > image.rows - 60) continue;
    ++visible;
    int best = -1, nearest = -1;
    double best_distance = 1e9;
    const double radius = 2.5 * std::pow(1.2, a.keypoints[i].octave + octave_change);
    for (int j = 0; j < b.Size(); ++j) {
      const double d = (b.keypoints[j].pixel - at).norm();
      const bool near = d < radius && std::abs(b.keypoints[j].octave - a.keypoints[i].octave - octave_change) < 1.6;
      if (near && d < best_distance) best_distance = d, best = j;
      if (nearest < 0 || HammingDistance(a.descriptors[i], b.descriptors[j]) <
                             HammingDistance(a.descriptors[i], b.descriptors[nearest])) {
        nearest = j;
      }
    }
    if (best < 0) continue;
    ++repeated;
    if ((b.keypoints[nearest].pixel - at).norm() > radius) continue;
    ++matched;
    if (a.keypoints[i].octave == 0) errors.push_back((b.keypoints[nearest].pixel - at).norm());
    const double turned =
        std::remainder(b.keypoints[nearest].angle - a.keypoints[i].angle - rotation, 2 * std::numbers::pi);
    if (b.keypoints[nearest].octave == a.keypoints[i].octave && scale_change == 1) {
      EXPECT_LT(std::abs(turned), 0.8);
    }
  }
  EXPECT_GT(visible, 300);
  std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
  return {double(repeated) / visible, double(matched) / repeated, errors[errors.size() / 2]};
}

cv::Matx33d SimilarityAbout(const cv::Mat& image, double rotation, double scale) {
  const double cx = image.cols / 2.0, cy = image.rows / 2.0;
  const double c = scale * std::cos(rotation), s = scale * std::sin(rotation);
  return {c, -s, cx - c * cx + s * cy, s, c, cy - s * cx - c * cy, 0, 0, 1};
}

TEST(OrbExtractor, GivesTheNumberAskedForSpreadOverTheImage) {
  const cv::Mat image = FlightImage();
  const RawFeatures features = Extractor(1000).Extract(image);
  EXPECT_EQ(features.Size(), 1000);
  EXPECT_EQ(features.descriptors.size(), features.keypoints.size());
  // Each of 8 x 6 cells of 100 pixels has its share (mean 20.8).
  std::vector<int> cells(48, 0), octaves(8, 0);
  for (const Keypoint& k : features.keypoints) {
    ASSERT_GE(k.pixel.minCoeff(), 18);
    ASSERT_LE(k.pixel.x(), image.cols - 19);
    ASSERT_LE(k.pixel.y(), image.rows - 19);
    ++cells[static_cast<int>(k.pixel.y() / 100) * 8 + static_cast<int>(k.pixel.x() / 100)];
    ++octaves[k.octave];
  }
  EXPECT_GE(*std::min_element(cells.begin(), cells.end()), 3);
  EXPECT_LE(*std::max_element(cells.begin(), cells.end()), 65);
  EXPECT_GE(*std::min_element(octaves.begin(), octaves.end()), 30);
  EXPECT_EQ(octaves[0], 217);  // 1000 * 1 / (1 + 1/1.2 + ... + 1/1.2^7)
}

TEST(OrbExtractor, RepeatsUnderRotationScaleAndPerspective) {
  const cv::Mat image = FlightImage();
  for (const double degrees : {25.0, 90.0, 200.0}) {
    const double rotation = degrees * std::numbers::pi / 180;
    const WarpResult r = MeasureWarp(image, SimilarityAbout(image, rotation, 1), 1, rotation);
    EXPECT_GT(r.repeatability, 0.65) << degrees;
    EXPECT_GT(r.match_rate, 0.75) << degrees;
    EXPECT_LT(r.median_error, 0.7) << degrees;
  }
  const WarpResult larger = MeasureWarp(image, SimilarityAbout(image, 0.1, 1.3), 1.3, 0.1);
  EXPECT_GT(larger.repeatability, 0.7);
  EXPECT_GT(larger.match_rate, 0.65);
  const WarpResult oblique = MeasureWarp(image, {1, 0.08, -20, 0.02, 1.05, -10, 5e-5, -8e-5, 1}, 1, 0);
  EXPECT_GT(oblique.repeatability, 0.65);
  EXPECT_GT(oblique.match_rate, 0.75);
}

TEST(OrbExtractor, CoarseOctavesAreNotBiased) {
  // Level positions must scale about the pixel corner, (x + 0.5) * 2 - 0.5. A mapping that forgets the
  // half pixel is off by up to 1.3 pixels at octave 7.
  const cv::Mat image = NoiseImage(400, 300);
  cv::Mat flipped;
  cv::flip(image, flipped, 1);
  OrbOptions options;
  options.num_features = 500;
  const RawFeatures a = OrbExtractor(options).Extract(image), b = OrbExtractor(options).Extract(flipped);
  // A mirrored image must give mirrored positions: x' = 399 - x.
  for (int octave = 0; octave < 8; ++octave) {
    int num = 0, near = 0;
    for (const Keypoint& k : a.keypoints) {
      if (k.octave != octave) continue;
      ++num;
      near += std::any_of(b.keypoints.begin(), b.keypoints.end(), [&](const Keypoint& m) {
        return m.octave == octave && (Eigen::Vector2f(399 - m.pixel.x(), m.pixel.y()) - k.pixel).norm() < 0.3;
      });
    }
    ASSERT_GT(num, 0) << octave;
    EXPECT_GT(near, 0.5 * num) << octave;
  }
}

TEST(OrbExtractor, DescriptorsAgreeWithOpenCv) {
  const cv::Mat image = FlightImage();
  OrbOptions options;
  options.num_levels = 1;
  const RawFeatures features = OrbExtractor(options).Extract(image);
  std::vector<cv::KeyPoint> keypoints;
  for (int i = 0; i < features.Size(); ++i) {
    const Keypoint& k = features.keypoints[i];
    cv::KeyPoint keypoint(k.pixel.x(), k.pixel.y(), 31, k.angle * 180 / CV_PI, 100, 0, i);
    if (keypoint.angle < 0) keypoint.angle += 360;
    keypoints.push_back(keypoint);
  }
  cv::Mat descriptors;
  cv::ORB::create(2000, 1.2f, 1)->compute(image, keypoints, descriptors);
  ASSERT_GT(keypoints.size(), 500u);
  std::vector<int> distances;
  for (size_t i = 0; i < keypoints.size(); ++i) {
    distances.push_back(HammingDistance(features.descriptors[keypoints[i].class_id], FromRow(descriptors.row(int(i)))));
  }
  std::sort(distances.begin(), distances.end());
  EXPECT_LE(distances[distances.size() / 2], 5);
  EXPECT_LE(distances[distances.size() * 95 / 100], 14);
}

TEST(OrbExtractor, IsDeterministic) {
  const OrbExtractor extractor = Extractor(800);
  const RawFeatures a = extractor.Extract(FlightImage()), b = extractor.Extract(FlightImage());
  ASSERT_EQ(a.Size(), b.Size());
  for (int i = 0; i < a.Size(); ++i) {
    EXPECT_EQ(a.keypoints[i].pixel, b.keypoints[i].pixel);
    EXPECT_EQ(a.keypoints[i].angle, b.keypoints[i].angle);
    EXPECT_EQ(a.descriptors[i], b.descriptors[i]);
  }
}

TEST(OrbExtractor, ViewsIntoLargerImagesGiveTheSame) {
  const cv::Mat large = NoiseImage(400, 300);
  const cv::Rect part(33, 21, 301, 207);
  const RawFeatures a = Extractor(300).Extract(large(part)), b = Extractor(300).Extract(large(part).clone());
  ASSERT_EQ(a.Size(), b.Size());
  EXPECT_TRUE(a.descriptors == b.descriptors);
}

TEST(OrbExtractor, WeakTextureIsFoundWhereThereIsNoOther) {
  // Left half strong texture, right half the same at a tenth of the contrast: below fast_threshold, above the minimum.
  cv::Mat image = NoiseImage(640, 480);
  cv::Mat weak;
  image(cv::Rect(0, 0, 320, 480)).convertTo(weak, CV_8U, 0.15, 100);
  weak.copyTo(image(cv::Rect(320, 0, 320, 480)));
  const RawFeatures features = Extractor(500).Extract(image);
  const auto right = std::count_if(features.keypoints.begin(), features.keypoints.end(),
                                   [](const Keypoint& k) { return k.pixel.x() > 340; });
  EXPECT_GT(right, 100);
}

TEST(OrbExtractor, TexturelessTinyAndNarrowImages) {
  const OrbExtractor extractor = Extractor(500);
  EXPECT_EQ(extractor.Extract(cv::Mat(480, 640, CV_8UC1, cv::Scalar(90))).Size(), 0);
  EXPECT_EQ(extractor.Extract(cv::Mat()).Size(), 0);
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(7, 7), cv::Size(38, 38), cv::Size(5, 400), cv::Size(400, 30)}) {
    EXPECT_EQ(extractor.Extract(NoiseImage(size.width, size.height)).Size(), 0) << size;
  }
  for (const cv::Size size : {cv::Size(39, 39), cv::Size(3000, 42), cv::Size(44, 2000), cv::Size(64, 48)}) {
    const RawFeatures features = extractor.Extract(NoiseImage(size.width, size.height));
    EXPECT_LE(features.Size(), 500);
    for (const Keypoint& k : features.keypoints) {
      EXPECT_TRUE(k.pixel.x() >= 18 && k.pixel.x() <= size.width - 19);
      EXPECT_TRUE(k.pixel.y() >= 18 && k.pixel.y() <= size.height - 19);
    }
  }
  const RawFeatures narrow = extractor.Extract(NoiseImage(3000, 42));
  EXPECT_GT(narrow.Size(), 50);
  float min_x = 1e9f, max_x = 0;
  for (const Keypoint& k : narrow.keypoints) min_x = std::min(min_x, k.pixel.x()), max_x = std::max(max_x, k.pixel.x());
  EXPECT_LT(min_x, 300);
  EXPECT_GT(max_x, 2700);
}

// What is masked makes room for others, and a mask that masks nothing changes nothing.
TEST(OrbExtractor, NoFeaturesUnderTheMask) {
  const cv::Mat image = FlightImage();
  const OrbExtractor extractor = Extractor(500);
  const RawFeatures all = extractor.Extract(image);
  cv::Mat mask(image.size(), CV_8UC1, cv::Scalar(255));
  EXPECT_EQ(extractor.Extract(image, &mask).descriptors, all.descriptors);
  mask.colRange(0, 300).setTo(0);
  const RawFeatures features = extractor.Extract(image, &mask);
  for (const Keypoint& k : features.keypoints) EXPECT_GE(k.pixel.x(), 299.5f);
  EXPECT_GT(features.Size(), 450);
  const auto is_left = [](const Keypoint& k) { return k.pixel.x() < 299; };
  EXPECT_GT(std::count_if(all.keypoints.begin(), all.keypoints.end(), is_left), 50);
}

TEST(OrbExtractor, RefusesBadInput) {
  EXPECT_THROW(Extractor(500).Extract(cv::Mat(100, 100, CV_8UC3)), std::invalid_argument);
  OrbOptions options;
  options.num_levels = 0;
  try {
    OrbExtractor extractor(options);
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("num_levels"));
  }
}

}  // namespace orb_extractor_test
}  // namespace mapmend
