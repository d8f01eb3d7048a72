#include "libs/positioning/exif_positions.h"

#include <gtest/gtest.h>

#include <exiv2/exiv2.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "libs/positioning/position_source.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace exif_positions_test {

std::string MakePhoto(const ScratchFolder& folder, const std::string& name, bool has_position) {
  const std::string path = folder.File(name);
  cv::imwrite(path, cv::Mat(8, 8, CV_8UC3, cv::Scalar(10, 20, 30)));
  if (!has_position) return path;
  const auto image = Exiv2::ImageFactory::open(path);
  image->readMetadata();
  Exiv2::ExifData tags;
  tags["Exif.GPSInfo.GPSLatitude"] = "28/1 2/1 2851/100";
  tags["Exif.GPSInfo.GPSLatitudeRef"] = "N";
  tags["Exif.GPSInfo.GPSLongitude"] = "82/1 41/1 5451/100";
  tags["Exif.GPSInfo.GPSLongitudeRef"] = "W";
  tags["Exif.GPSInfo.GPSAltitude"] = "5677/1000";
  tags["Exif.GPSInfo.GPSAltitudeRef"] = "1";
  image->setExifData(tags);
  image->writeMetadata();
  return path;
}

TEST(ExifPositions, OfAPhoto) {
  const ScratchFolder folder;
  const auto fix = ReadExifPosition(MakePhoto(folder, "a.jpg", true));
  ASSERT_TRUE(fix);
  EXPECT_NEAR(fix->latitude_deg, 28 + 2 / 60.0 + 28.51 / 3600, 1e-9);
  EXPECT_NEAR(fix->longitude_deg, -(82 + 41 / 60.0 + 54.51 / 3600), 1e-9);
  EXPECT_NEAR(fix->altitude_m, -5.677, 1e-9);
  EXPECT_FALSE(fix->HasAngles());
  EXPECT_FALSE(ReadExifPosition(MakePhoto(folder, "b.jpg", false)));
  EXPECT_FALSE(ReadExifPosition(folder.File("none.jpg")));
}

TEST(ExifPositions, OfAFolderAreTakenByThemselves) {
  const ScratchFolder folder;
  const std::vector<std::string> photos = {MakePhoto(folder, "1.jpg", false), MakePhoto(folder, "2.jpg", true)};
  PositionSource source = PositionSource::Open("", "", {folder.Path()}, photos);
  EXPECT_NE(source.Note().find("1 of 2"), std::string::npos) << source.Note();
  EXPECT_TRUE(source.TakeFor(0, 100).empty());
  ASSERT_EQ(source.TakeFor(1, 200).size(), 1u);
  EXPECT_TRUE(PositionSource::Open("none", "", {folder.Path()}, photos).IsEmpty());
  EXPECT_THROW(PositionSource::Open("exif", "", {folder.Path()}, {photos[0]}), std::runtime_error);
}

}  // namespace exif_positions_test
}  // namespace mapmend
