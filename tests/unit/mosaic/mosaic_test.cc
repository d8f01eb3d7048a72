#include "libs/mosaic/mosaic.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <set>

#include "libs/mosaic/brightness.h"
#include "tests/unit/mosaic/synthetic_ground.h"

namespace mapmend {
namespace mosaic_test {

// Two strips of images, some turned, one tilted, exposed differently.
std::vector<MosaicImage> Images(const Camera& camera = SyntheticGround::MakeCamera()) {
  std::vector<MosaicImage> images;
  for (int i = 0; i < 4; ++i) images.push_back({camera, SyntheticGround::Above(2.5 * i, 0, 10, 0.1 * i)});
  for (int i = 0; i < 4; ++i) images.push_back({camera, SyntheticGround::Above(7.5 - 2.5 * i, 4, 10.5, 3.1, 0.05 * i)});
  return images;
}

struct Picture {
  cv::Mat color, mask;

  explicit Picture(Mosaic* mosaic)
      : color(cv::Mat::zeros(mosaic->Raster().height, mosaic->Raster().width, CV_8UC3)),
        mask(cv::Mat::zeros(color.size(), CV_8U)) {
    mosaic->Make(
        [&](const cv::Mat& block, const cv::Mat& block_mask, const cv::Rect& at) {
          block.copyTo(color(at));
          block_mask.copyTo(mask(at));
        },
        {});
  }
};

// The same part of the ground as it is.
cv::Mat Truth(const GroundRaster& raster) {
  cv::Mat truth(raster.height, raster.width, CV_8UC3);
  for (int row = 0; row < truth.rows; ++row) {
    for (int column = 0; column < truth.cols; ++column) {
      const Eigen::Vector2d place = raster.Place(column, row);
      truth.at<cv::Vec3b>(row, column) = SyntheticGround::ColorAt(place.x(), place.y());
    }
  }
  return truth;
}

TEST(Mosaic, IsThePictureOfTheGround) {
  Camera camera = SyntheticGround::MakeCamera();
  camera.distortion = {-0.1, 0.02, 0.001, -0.001, 0};
  const std::vector<MosaicImage> images = Images(camera);
  Mosaic mosaic({}, images, SyntheticGround::Points(), [&](int i, int) { return SyntheticGround::View(images[i]); });
  ASSERT_EQ(mosaic.Problem(), "");
  EXPECT_NEAR(mosaic.Raster().gsd, 10.25 / 300, 0.002);
  const Picture picture(&mosaic);
  EXPECT_GT(cv::countNonZero(picture.mask), 0.7 * static_cast<double>(picture.mask.total()));
  cv::Mat difference;
  cv::absdiff(picture.color, Truth(mosaic.Raster()), difference);
  const cv::Scalar mean = cv::mean(difference, picture.mask);
  for (int c = 0; c < 3; ++c) EXPECT_LT(mean[c], 1.5) << "grey levels, channel " << c;
  EXPECT_EQ(mosaic.NumMissing(), 0);
}

TEST(Mosaic, OfManyImagesOfOnePlaceFewAreUsedAndNothingIsMissing) {
  std::vector<MosaicImage> images;
  for (int i = 0; i < 40; ++i)
    images.push_back({SyntheticGround::MakeCamera(), SyntheticGround::Above(0.25 * i, 0, 10, 0.002 * i)});
  const auto draw = [&](double spacing, std::set<int>* used) {
    MosaicOptions options;
    options.scene.spacing = spacing;
    Mosaic mosaic(options, images, SyntheticGround::Points(), [&](int i, int side) {
      if (side != kBrightnessSide) used->insert(i);
      return SyntheticGround::View(images[i]);
    });
    const Picture picture(&mosaic);
    cv::Mat difference;
    cv::absdiff(picture.color, Truth(mosaic.Raster()), difference);
    EXPECT_LT(cv::mean(difference, picture.mask)[0], 1.5);
    return picture.mask;
  };
  std::set<int> few, all;
  const cv::Mat mask = draw(0.2, &few), whole = draw(0, &all);
  EXPECT_LE(few.size(), 10u);
  EXPECT_GE(all.size(), 35u);
  // But for pixels at the very rim, between the places at which images are compared.
  EXPECT_LT(cv::countNonZero(mask != whole), 0.003 * cv::countNonZero(whole));
}

TEST(Mosaic, ImagesExposedDifferentlyAreEvened) {
  const std::vector<MosaicImage> images = Images();
  Mosaic mosaic({}, images, SyntheticGround::Points(),
                [&](int i, int) { return SyntheticGround::View(images[i], 0.8 + 0.05 * i); });
  const Picture picture(&mosaic);
  cv::Mat ratio, truth = Truth(mosaic.Raster());
  cv::Mat color = picture.color;
  color.convertTo(color, CV_32FC3);
  truth.convertTo(truth, CV_32FC3);
  cv::divide(color, truth, ratio);
  cv::Scalar mean, deviation;
  cv::meanStdDev(ratio, mean, deviation, picture.mask);
  for (int c = 0; c < 3; ++c) EXPECT_LT(deviation[c], 0.02) << "between 0.8 and 1.15 before";
}

TEST(Mosaic, DoesNotDependOnItsBlocks) {
  const std::vector<MosaicImage> images = Images();
  const auto make = [&](int block) {
    MosaicOptions options;
    options.block = block;
    Mosaic mosaic(options, images, SyntheticGround::Points(),
                  [&](int i, int) { return SyntheticGround::View(images[i]); });
    return Picture(&mosaic);
  };
  const Picture whole = make(4096), small = make(128);
  cv::Mat difference;
  cv::absdiff(whole.color, small.color, difference);
  EXPECT_LT(cv::mean(difference)[0], 0.3);
  EXPECT_LT(cv::countNonZero(whole.mask != small.mask), 0.005 * static_cast<double>(whole.mask.total()));
}

TEST(Mosaic, AMissingImageLeavesItsPlaceToTheOthers) {
  const std::vector<MosaicImage> images = Images();
  Mosaic mosaic({}, images, SyntheticGround::Points(),
                [&](int i, int) { return i == 2 ? cv::Mat() : SyntheticGround::View(images[i]); });
  const Picture picture(&mosaic);
  EXPECT_EQ(mosaic.NumMissing(), 1);
  const Eigen::Vector2d below = mosaic.Raster().Pixel(images[2].cam_from_ground.Center().head<2>());
  EXPECT_EQ(picture.mask.at<uint8_t>(static_cast<int>(below.y()), static_cast<int>(below.x())), 255);
}

// The second image, which shows the place straight below it best, and its corner of the ground alone.
TEST(Mosaic, AnOverexposedOrDarkImageIsSeenOnlyWhereNoOtherIs) {
  const Camera camera = SyntheticGround::MakeCamera();
  const std::vector<MosaicImage> images = {{camera, SyntheticGround::Above(0, 0, 10)},
                                           {camera, SyntheticGround::Above(4, 0, 10)}};
  for (const double gain : {20.0, 0.01}) {
    Mosaic mosaic({}, images, SyntheticGround::Points(),
                  [&](int i, int) { return SyntheticGround::View(images[i], i == 1 ? gain : 1); });
    const Picture picture(&mosaic);
    const auto at = [&](double x, double y) {
      const Eigen::Vector2d pixel = mosaic.Raster().Pixel({x, y});
      return cv::Point(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
    };
    const cv::Vec3b truth = SyntheticGround::ColorAt(3.5, 0);
    EXPECT_LT(cv::norm(picture.color.at<cv::Vec3b>(at(3.5, 0)), truth), 20) << "both show it";
    EXPECT_EQ(picture.mask.at<uint8_t>(at(8, 0)), 255) << "only the second one does";
  }
}

TEST(Mosaic, TellsWhyThereIsNone) {
  const auto problem = [](const std::vector<MosaicImage>& images, const std::vector<Eigen::Vector3d>& points) {
    return Mosaic({}, images, points, [](int, int) { return cv::Mat(); }).Problem();
  };
  const Camera camera = SyntheticGround::MakeCamera();
  EXPECT_NE(problem({{camera, SyntheticGround::Above(0, 0, 10, 0, 1.5)}}, SyntheticGround::Points()).find("86 degrees"),
            std::string::npos);
  EXPECT_NE(problem({{camera, SyntheticGround::Above(0, 0, -10)}}, SyntheticGround::Points()).find("below the ground"),
            std::string::npos);
  EXPECT_NE(problem({}, SyntheticGround::Points()).find("no keyframe"), std::string::npos);
  std::vector<Eigen::Vector3d> room;
  for (int i = 0; i < 4000; ++i) room.emplace_back(0.01 * (i % 997), 0.01 * (i % 991), (i * 37) % 100 * 0.3 - 15);
  EXPECT_NE(problem({{camera, SyntheticGround::Above(5, 5, 10)}}, room).find("away from any ground surface"),
            std::string::npos);
}

TEST(Mosaic, CoverageCountsImages) {
  const std::vector<MosaicImage> images = Images();
  const Mosaic mosaic({}, images, SyntheticGround::Points(), {});
  const cv::Mat coverage = mosaic.Coverage(8);
  double most = 0;
  cv::minMaxLoc(coverage, nullptr, &most);
  EXPECT_GE(most, 4);
  EXPECT_LE(most, 8);
}

TEST(Mosaic, CoverageCountsWhatEachImageSeesOfEachPlace) {
  const std::vector<MosaicImage> images = Images();
  const Mosaic mosaic({}, images, SyntheticGround::Points(), {});
  const GroundScene scene({}, images, SyntheticGround::Points());
  for (const int step : {1, 5}) {
    const cv::Mat coverage = mosaic.Coverage(step);
    int num_wrong = 0;
    for (int row = 0; row < coverage.rows; ++row) {
      for (int column = 0; column < coverage.cols; ++column) {
        const Eigen::Vector3d place = scene.OnSurface(mosaic.Raster().Place((column + 0.5) * step, (row + 0.5) * step));
        int count = 0;
        for (int i = 0; i < scene.NumImages(); ++i) count += scene.View(i).See(place) ? 1 : 0;
        num_wrong += count == coverage.at<uint16_t>(row, column) ? 0 : 1;
      }
    }
    EXPECT_EQ(num_wrong, 0) << "of " << coverage.total();
  }
}

}  // namespace mosaic_test
}  // namespace mapmend
