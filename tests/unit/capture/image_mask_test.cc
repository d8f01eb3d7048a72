#include "libs/capture/image_mask.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "libs/base/write_file.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace image_mask_test {

class ImageMaskTest : public ::testing::Test {
 protected:
  std::string WriteImage(const std::string& name, const cv::Mat& image) {
    cv::imwrite(folder_.File(name), image);
    return folder_.File(name);
  }
  std::string WriteText(const std::string& text) {
    WriteFile(folder_.File("m.yaml"), text);
    return folder_.File("m.yaml");
  }
  static std::string ErrorOf(const std::string& path) {
    try {
      ReadMask(path, 80, 60);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  }
  ScratchFolder folder_;
};

// The upper half is left out, whatever the image is like.
TEST_F(ImageMaskTest, BlackIsWhereNoFeaturesMayBe) {
  cv::Mat grey(120, 160, CV_8UC1, cv::Scalar(255));
  grey.rowRange(0, 60).setTo(0);
  cv::Mat color, alpha, deep;
  cv::cvtColor(grey, color, cv::COLOR_GRAY2BGR);
  cv::merge(std::vector<cv::Mat>{grey * 0 + 255, grey * 0 + 255, grey * 0 + 255, grey}, alpha);
  grey.convertTo(deep, CV_16U, 257);
  for (const std::string& path :
       {WriteImage("grey.png", grey), WriteImage("color.png", color), WriteImage("alpha.png", alpha),
        WriteImage("deep.png", deep), WriteImage("lossy.jpg", grey)}) {
    const cv::Mat mask = ReadMask(path, 80, 60);
    ASSERT_EQ(mask.size(), cv::Size(80, 60)) << path;
    EXPECT_EQ(cv::countNonZero(mask.rowRange(0, 30)), 0) << path;
    EXPECT_EQ(cv::countNonZero(mask.rowRange(30, 60)), 80 * 30) << path;
  }
}

TEST_F(ImageMaskTest, RectanglesAsOpenvslamHasThem) {
  for (const char* text : {"mask_rectangles:\n  - [0.0, 1.0, 0.0, 0.5]\n  - [0, 0.1, 0, 1]\n",
                           "%YAML:1.0\nFeature.mask_rectangles: [[0.0, 1.0, 0.0, 0.5], [0, 0.1, 0, 1]]\n",
                           "Feature:\n  mask_rectangles:\n    - [0.0, 1.0, 0.0, 0.5]\n    - [0, 0.1, 0, 1]\n"}) {
    const cv::Mat mask = ReadMask(WriteText(text), 80, 60);
    EXPECT_EQ(cv::countNonZero(mask), 72 * 30) << text;
    EXPECT_EQ(cv::countNonZero(mask.rowRange(0, 30)), 0) << text;
  }
}

TEST_F(ImageMaskTest, ErrorsAreOneLineThatNamesTheFile) {
  const auto expect = [](const std::string& path, const std::string& part) {
    const std::string error = ErrorOf(path);
    EXPECT_NE(error.find(part), std::string::npos) << error;
    EXPECT_NE(error.find(path), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  };
  expect("/no/such/mask.png", "cannot be read");
  expect(WriteImage("wide.png", cv::Mat(60, 120, CV_8UC1, cv::Scalar(255))),
         "has 120 x 60 pixels, the images have 80 x 60");
  expect(WriteImage("black.png", cv::Mat(60, 80, CV_8UC1, cv::Scalar(0))), "covers the whole image");
  expect(WriteText("no mask\n"), "neither an image nor YAML");
  expect(WriteText("a: [1\n"), "neither an image nor YAML");
  expect(WriteText("mask_rectangles: [[0, 2, 0, 1]]\n"), "fractions from 0 to 1");
  expect(WriteText("mask_rectangles: [[0, 1, 0, 1]]\n"), "covers the whole image");
  expect(WriteText(""), "is empty");
}

}  // namespace image_mask_test
}  // namespace mapmend
