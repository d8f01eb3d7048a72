#include "libs/capture/exif_camera.h"

#include <gtest/gtest.h>

#include <exiv2/exiv2.hpp>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/scratch_folder.h"

namespace mapmend {
namespace exif_camera_test {

using Tags = std::map<std::string, std::string>;

class ExifCameraTest : public testing::Test {
 protected:
  std::string Photo(const std::string& name, const Tags& tags, int width = 400, int height = 300) {
    const std::string path = folder_.File(name);
    cv::imwrite(path, cv::Mat(height, width, CV_8UC1, cv::Scalar(90)));
    if (tags.empty()) return path;
    const auto image = Exiv2::ImageFactory::open(path);
    image->readMetadata();
    for (const auto& [tag, value] : tags) image->exifData()["Exif." + tag] = value;
    image->writeMetadata();
    return path;
  }
  // What the tags of one photo give.
  ExifCamera Guess(const Tags& tags, int width = 400, int height = 300) {
    return GuessCamera({Photo("photo.jpg", tags, width, height)});
  }

  ScratchFolder folder_;
};

TEST_F(ExifCameraTest, OfAKnownDroneTheSensorIsKnown) {
  const ExifCamera guess = Guess({{"Image.Make", "DJI"}, {"Image.Model", "FC300X"}, {"Photo.FocalLength", "361/100"}});
  ASSERT_TRUE(guess.found) << guess.note;
  EXPECT_NEAR(guess.camera.fx, 3.61 / 6.17 * 400, 1e-9);
  EXPECT_EQ(guess.camera.fy, guess.camera.fx);
  EXPECT_EQ(guess.camera.cx, 199.5);
  EXPECT_EQ(guess.camera.cy, 149.5);
  EXPECT_EQ(guess.camera.width, 400);
  EXPECT_EQ(guess.camera.height, 300);
  EXPECT_FALSE(guess.camera.HasDistortion());
  EXPECT_EQ(guess.note,
            "camera guessed from EXIF: DJI FC300X, focal length 234 px of 400 x 300: 3.61 mm over a sensor of 6.17 mm "
            "(known of FC300X); a calibration is better (`mapmend calibrate` makes one of the finished map)");
}

TEST_F(ExifCameraTest, TheResolutionOfTheFocalPlaneIsThatOfTheFullPhoto) {
  // 4000 pixels on 13.2 mm, in all units; the photo at hand is a tenth as wide.
  for (const auto& [unit, resolution] : {std::pair("2", "7696970/1000"), std::pair("3", "3030303/1000"),
                                         std::pair("4", "303030/1000"), std::pair("5", "303030/1000000")}) {
    const ExifCamera guess = Guess({{"Photo.FocalLength", "88/10"},
                                    {"Photo.FocalPlaneXResolution", resolution},
                                    {"Photo.FocalPlaneResolutionUnit", unit},
                                    {"Photo.PixelXDimension", "4000"},
                                    {"Photo.PixelYDimension", "3000"}});
    ASSERT_TRUE(guess.found) << guess.note;
    EXPECT_NEAR(guess.camera.fx, 8.8 / 13.2 * 400, 0.05) << "unit " << unit;
  }
}

TEST_F(ExifCameraTest, TheEquivalentOf35MillimetresGoesByTheDiagonal) {
  const ExifCamera guess = Guess({{"Photo.FocalLengthIn35mmFilm", "20"}});
  ASSERT_TRUE(guess.found) << guess.note;
  EXPECT_NEAR(guess.camera.fx, 20 / 43.267 * 500, 1e-6);
  // A sensor that cannot be is not believed.
  EXPECT_NEAR(Guess({{"Photo.FocalLength", "361/100"},
                     {"Photo.FocalPlaneXResolution", "72/1"},
                     {"Photo.FocalLengthIn35mmFilm", "20"}})
                  .camera.fx,
              20 / 43.267 * 500, 1e-6);
}

TEST_F(ExifCameraTest, AnUprightPhotoHasTheSameFocalLength) {
  const Tags tags = {{"Image.Model", "FC6310"}, {"Photo.FocalLength", "88/10"}};
  EXPECT_NEAR(Guess(tags, 300, 400).camera.fx, Guess(tags).camera.fx, 1e-9);
}

TEST_F(ExifCameraTest, WithoutAFocalLengthThereIsNone) {
  EXPECT_FALSE(Guess({}).found);
  EXPECT_EQ(Guess({}).note, "");
  const ExifCamera guess = Guess({{"Image.Model", "XYZ"}, {"Photo.FocalLength", "5/1"}});
  EXPECT_FALSE(guess.found);
  EXPECT_EQ(guess.note, "the EXIF of photo.jpg does not tell a focal length with a sensor");
  EXPECT_FALSE(Guess({{"Photo.FocalLengthIn35mmFilm", "0"}, {"Photo.FocalLength", "0/0"}}).found);
  EXPECT_FALSE(GuessCamera({folder_.File("missing.jpg")}).found);
  EXPECT_FALSE(GuessCamera({}).found);
}

TEST_F(ExifCameraTest, PhotosOfDifferentFocalLengthsAreRefusedAndNamed) {
  const std::string a = Photo("a.jpg", {{"Photo.FocalLengthIn35mmFilm", "24"}});
  const std::string b = Photo("b.jpg", {});
  const std::string c = Photo("c.jpg", {{"Photo.FocalLengthIn35mmFilm", "48"}});
  EXPECT_TRUE(GuessCamera({a, b, a}).found) << "one without EXIF does not matter";
  const ExifCamera guess = GuessCamera({a, b, c});
  EXPECT_FALSE(guess.found);
  EXPECT_EQ(guess.note, "the photos' EXIF tells different focal lengths (277 px in a.jpg, 555 px in c.jpg)");
}

}  // namespace exif_camera_test
}  // namespace mapmend
