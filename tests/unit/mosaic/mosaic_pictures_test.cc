#include "libs/mosaic/mosaic_pictures.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace mosaic_pictures_test {

TEST(MosaicPreview, IsTheMeanOfWhatIsShown) {
  const GroundRaster raster{{0, 0}, 0.5, 400, 200};
  MosaicPreview preview(raster, 100);
  EXPECT_EQ(preview.Gsd(), 2);
  cv::Mat color(200, 200, CV_8UC3, cv::Scalar(10, 20, 30)), mask(200, 200, CV_8U, cv::Scalar(255));
  color.colRange(0, 2).setTo(cv::Scalar(50, 60, 70));
  mask.rowRange(100, 200).setTo(0);
  preview.Add(color, mask, {200, 0, 200, 200});
  const cv::Mat picture = preview.Picture();
  ASSERT_EQ(picture.size(), cv::Size(100, 50));
  EXPECT_EQ(picture.at<cv::Vec4b>(10, 20), cv::Vec4b(0, 0, 0, 0)) << "beside the block";
  EXPECT_EQ(picture.at<cv::Vec4b>(10, 50), cv::Vec4b(30, 40, 50, 255)) << "half of its pixels are brighter";
  EXPECT_EQ(picture.at<cv::Vec4b>(10, 60), cv::Vec4b(10, 20, 30, 255));
  EXPECT_EQ(picture.at<cv::Vec4b>(40, 60)[3], 0) << "masked out";
}

TEST(ScaleMarks, ABarOnlyWhereLengthsMeanSomething) {
  const auto changed = [](const ScaleMarks& marks) {
    cv::Mat picture(300, 400, CV_8UC4, cv::Scalar(90, 90, 90, 255));
    const cv::Mat before = picture.clone();
    DrawScaleMarks(marks, &picture);
    cv::Mat difference;
    cv::absdiff(picture.reshape(1), before.reshape(1), difference);
    return cv::countNonZero(difference);
  };
  EXPECT_EQ(changed({1, "", false}), 0);
  EXPECT_GT(changed({1, "m", false}), 200);
  EXPECT_GT(changed({1, "", true}), 200);
}

TEST(CoveragePicture, FromRedToBlue) {
  cv::Mat coverage = cv::Mat::zeros(300, 300, CV_16U);
  coverage.at<uint16_t>(200, 200) = 1;
  coverage.at<uint16_t>(200, 201) = 900;
  const cv::Mat picture = CoveragePicture(coverage);
  const auto &few = picture.at<cv::Vec4b>(200, 200), &many = picture.at<cv::Vec4b>(200, 201);
  EXPECT_GT(few[2], few[0]);
  EXPECT_GT(many[0], many[2]);
  EXPECT_EQ(picture.at<cv::Vec4b>(200, 202)[3], 0);
}

}  // namespace mosaic_pictures_test
}  // namespace mapmend
