#include "procs/frontend/frame_maker.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace mapmend {
namespace frame_maker_test {

Camera MakeCamera(double k1) {
  Camera camera;
  camera.width = 400, camera.height = 300;
  camera.fx = camera.fy = 240, camera.cx = 199.5, camera.cy = 149.5;
  camera.distortion[0] = k1;
  return camera;
}

SourceImage Noise() {
  auto image = std::make_shared<cv::Mat>(300, 400, CV_8UC1);
  cv::RNG rng(7);
  rng.fill(*image, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(*image, *image, cv::Size(0, 0), 1.5);
  cv::normalize(*image, *image, 0, 255, cv::NORM_MINMAX);
  return {0, 0, image};
}

// The curve r (1 - 0.3 r^2) is largest at r = 1.054, where it is 0.703: 169 pixels from the centre.
TEST(FrameMaker, FeaturesWithoutAPlaceInTheLensModelAreLeftOut) {
  const Camera camera = MakeCamera(-0.3);
  const FramePtr frame = FrameMaker(camera, camera, OrbOptions()).Make(Noise());
  const FramePtr all = FrameMaker(MakeCamera(0), MakeCamera(0), OrbOptions()).Make(Noise());
  EXPECT_GT(frame->num_unseen, 0);
  EXPECT_EQ(all->num_unseen, 0);
  EXPECT_EQ(frame->features.Size() + static_cast<size_t>(frame->num_unseen), all->features.Size());
  ASSERT_EQ(frame->features.keypoints.size(), frame->features.descriptors.size());
  ASSERT_EQ(frame->features.keypoints.size(), frame->features.colors.size());
  const Pinhole ideal = camera.Ideal();
  for (const Keypoint& k : frame->features.keypoints) {
    const Eigen::Vector3d ray = ideal.Unproject(k.pixel.cast<double>());
    EXPECT_LT(ray.head<2>().norm(), 1.06);
    const Eigen::Vector2d pixel = camera.Project(ray);
    EXPECT_TRUE(pixel.x() > 0 && pixel.x() < 400 && pixel.y() > 0 && pixel.y() < 300);
  }
}

TEST(FrameMaker, NoFeaturesUnderTheMask) {
  auto mask = std::make_shared<cv::Mat>(300, 400, CV_8UC1, cv::Scalar(255));
  mask->rowRange(0, 150).setTo(0);
  const FramePtr frame = FrameMaker(MakeCamera(0), MakeCamera(0), OrbOptions(), mask).Make(Noise());
  EXPECT_GT(frame->features.Size(), 100u);
  for (const Keypoint& k : frame->features.keypoints) EXPECT_GE(k.pixel.y(), 149.0f);
}

// Left half red, right half green.
TEST(FrameMaker, WideFeaturesTakeThePlaceOfThoseOfOrb) {
  const SourceImage grey = Noise();
  const cv::Mat none(grey.pixels->size(), CV_8UC1, cv::Scalar(0));
  cv::Mat left = grey.pixels->clone(), right = grey.pixels->clone();
  left.colRange(200, 400).setTo(0);
  right.colRange(0, 200).setTo(0);
  auto pixels = std::make_shared<cv::Mat>();
  cv::merge(std::vector<cv::Mat>{none, right, left}, *pixels);
  const Camera camera = MakeCamera(-0.1);
  const FrameMaker maker(camera, camera, OrbOptions(), nullptr, true);
  const FramePtr photo = maker.Make({3, 7000, pixels});
  const FramePtr wide = maker.WithWideFeatures(photo, {.max_features = 5000, .contrast_threshold = 0.01});
  EXPECT_EQ(wide->index, 3);
  EXPECT_EQ(wide->utime, 7000);
  EXPECT_EQ(wide->photo, photo);
  EXPECT_EQ(HolderOf(wide), photo) << "it holds the images";
  EXPECT_GT(wide->features.Size(), 200);
  ASSERT_EQ(wide->features.keypoints.size(), wide->features.descriptors.size());
  ASSERT_EQ(wide->features.keypoints.size(), wide->features.colors.size());
  int num_left = 0;
  for (int i = 0; i < wide->features.Size(); ++i) {
    const Keypoint& k = wide->features.keypoints[i];
    const double x = camera.Project(camera.Ideal().Unproject(k.pixel.cast<double>())).x();
    const auto& [red, green, blue] = wide->features.colors[i];
    EXPECT_EQ(blue, 0);
    EXPECT_TRUE(x >= 196 || green == 0) << x;
    EXPECT_TRUE(x <= 204 || red == 0) << x;
    num_left += x < 200;
  }
  EXPECT_GT(num_left, 50);
  EXPECT_GT(wide->features.Size() - num_left, 50);
}

}  // namespace frame_maker_test
}  // namespace mapmend
