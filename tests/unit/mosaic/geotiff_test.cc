#include "libs/mosaic/geotiff.h"

#include <gdal_priv.h>
#include <gtest/gtest.h>

#include <array>
#include <filesystem>

#include "tests/scratch_folder.h"

namespace mapmend {
namespace geotiff_test {

const GroundRaster kRaster{{500000, 5400000}, 0.25, 700, 600};

TEST(GeoTiff, LiesWhereTheRasterSays) {
  const ScratchFolder folder;
  const std::string path = folder.File("mosaic.tif");
  GeoTiffWriter writer(path, kRaster, 32631);
  const cv::Mat color(100, 200, CV_8UC3, cv::Scalar(10, 100, 200)), mask(100, 200, CV_8U, cv::Scalar(255));
  writer.Write(color, mask, {300, 400, 200, 100});
  EXPECT_FALSE(std::filesystem::exists(path)) << "not before it is whole";
  writer.Finish();
  auto* dataset = static_cast<GDALDataset*>(GDALOpen(path.c_str(), GA_ReadOnly));
  ASSERT_NE(dataset, nullptr);
  EXPECT_EQ(dataset->GetRasterXSize(), 700);
  EXPECT_EQ(dataset->GetRasterYSize(), 600);
  std::array<double, 6> transform;
  dataset->GetGeoTransform(transform.data());
  EXPECT_EQ(transform, (std::array<double, 6>{500000, 0.25, 0, 5400000, 0, -0.25}));
  EXPECT_NE(std::string(dataset->GetProjectionRef()).find("UTM zone 31N"), std::string::npos);
  uint8_t red = 0, shown = 0, hidden = 9;
  const auto read = [&](GDALRasterBand* band, int x, int y, uint8_t* value) {
    EXPECT_EQ(band->RasterIO(GF_Read, x, y, 1, 1, value, 1, 1, GDT_Byte, 0, 0, nullptr), CE_None);
  };
  read(dataset->GetRasterBand(1), 400, 450, &red);
  read(dataset->GetRasterBand(1)->GetMaskBand(), 400, 450, &shown);
  read(dataset->GetRasterBand(1)->GetMaskBand(), 10, 10, &hidden);
  EXPECT_NEAR(red, 200, 4);
  EXPECT_EQ(shown, 255);
  EXPECT_EQ(hidden, 0);
  GDALClose(dataset);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.Path()), {}), 1) << "nothing else is left";
}

std::string ReadZipped(const std::string& path) {
  VSILFILE* file = VSIFOpenL(("/vsizip/" + path).c_str(), "rb");
  if (file == nullptr) return "";
  std::string text(10000, ' ');
  text.resize(VSIFReadL(text.data(), 1, text.size(), file));
  VSIFCloseL(file);
  return text;
}

TEST(GeoTiff, AnOverlayForGoogleEarthLiesThereToo) {
  const ScratchFolder folder;
  GeoTiffWriter writer(folder.File("mosaic.tif"), kRaster, 32631);
  const cv::Mat color(600, 700, CV_8UC3, cv::Scalar(10, 100, 200)), mask(600, 700, CV_8U, cv::Scalar(255));
  writer.Write(color, mask, {0, 0, 700, 600});
  writer.Finish(folder.File("mosaic.kmz"));
  EXPECT_TRUE(std::filesystem::exists(folder.File("mosaic.tif")));
  const std::string document = ReadZipped(folder.File("mosaic.kmz") + "/doc.kml");
  // The corner is on the central meridian of zone 31.
  EXPECT_NE(document.find("<west>3.0000"), std::string::npos) << document;
  EXPECT_NE(document.find("<north>48.753"), std::string::npos) << document;
  EXPECT_NE(document.find("<href>0/0/0.kml</href>"), std::string::npos) << document;
  const std::string coarse = ReadZipped(folder.File("mosaic.kmz") + "/0/0/0.kml");
  EXPECT_NE(coarse.find("<GroundOverlay>"), std::string::npos) << coarse;
  EXPECT_NE(coarse.find("../../1/0/0.kml"), std::string::npos) << "finer ones";
  EXPECT_FALSE(ReadZipped(folder.File("mosaic.kmz") + "/1/0/0.jpg").empty());
}

TEST(GeoTiff, LeavesNothingBehindUnlessItIsFinished) {
  const ScratchFolder folder;
  { const GeoTiffWriter writer(folder.File("mosaic.tif"), kRaster, 0); }
  EXPECT_TRUE(std::filesystem::is_empty(folder.Path()));
}

TEST(GeoTiff, SaysWhichFileCannotBeWritten) {
  try {
    const GeoTiffWriter writer("/nowhere/mosaic.tif", kRaster, 0);
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("/nowhere/mosaic.tif: cannot be written"), std::string::npos) << e.what();
  }
}

TEST(GeoTiff, HeightsAreThoseOfTheSurface) {
  const ScratchFolder folder;
  WriteHeights(folder.File("surface.tif"), GroundSurface(12.5), kRaster, 8, {100, 0, 3}, 0);
  auto* dataset = static_cast<GDALDataset*>(GDALOpen((folder.File("surface.tif")).c_str(), GA_ReadOnly));
  ASSERT_NE(dataset, nullptr);
  float height = 0;
  EXPECT_EQ(dataset->GetRasterBand(1)->RasterIO(GF_Read, 5, 5, 1, 1, &height, 1, 1, GDT_Float32, 0, 0, nullptr),
            CE_None);
  EXPECT_EQ(height, 15.5F);
  std::array<double, 6> transform;
  dataset->GetGeoTransform(transform.data());
  EXPECT_EQ(transform[0], 500100);
  GDALClose(dataset);
}

}  // namespace geotiff_test
}  // namespace mapmend
