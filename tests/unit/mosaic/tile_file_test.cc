#include "libs/mosaic/tile_file.h"

#include <gdal_priv.h>
#include <gdal_utils.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgproc.hpp>

#include "tests/scratch_folder.h"

namespace mapmend {
namespace tile_file_test {

cv::Mat Plain(const cv::Vec3b& color, int shown_columns = kTilePixels) {
  cv::Mat picture = cv::Mat::zeros(kTilePixels, kTilePixels, CV_8UC4);
  picture.colRange(0, shown_columns).setTo(cv::Scalar(color[0], color[1], color[2], 255));
  return picture;
}

TEST(TileFile, TilesComeBack) {
  EXPECT_TRUE(EncodeTile(Plain({1, 2, 3}, 0)).empty()) << "nothing is shown";
  const std::vector<uint8_t> full = EncodeTile(Plain({10, 100, 200})), border = EncodeTile(Plain({10, 100, 200}, 100));
  EXPECT_EQ(full[0], 0xFF) << "JPEG";
  EXPECT_EQ(border[1], 'P') << "PNG";
  const cv::Mat picture = DecodeTile(border);
  EXPECT_EQ(picture.at<cv::Vec4b>(7, 99), cv::Vec4b(10, 100, 200, 255));
  EXPECT_EQ(picture.at<cv::Vec4b>(7, 100), cv::Vec4b(0, 0, 0, 0));
  EXPECT_NEAR(DecodeTile(full).at<cv::Vec4b>(7, 200)[2], 200, 3);
  EXPECT_EQ(cv::countNonZero(DecodeTile({1, 2, 3}).reshape(1)), 0) << "no picture";
}

TEST(TileFile, CoarserTilesFollowTheFinestOnes) {
  const ScratchFolder folder;
  TileFile file(folder.File("a.mbtiles"));
  const TileAddress tile{12, 2100, 1400};
  TileFile::Changes changes;
  changes.tiles[tile] = EncodeTile(Plain({0, 0, 200}));
  changes.tiles[{12, 2101, 1400}] = EncodeTile(Plain({200, 0, 0}));
  changes.notes[tile.Parent()] = "a note";
  file.Put(changes);
  file.UpdateCoarser(10);
  ASSERT_EQ(file.Tiles().size(), 4u) << "two, their parent, and its";
  const cv::Mat parent = DecodeTile(*file.Tile({11, 1050, 700}));
  EXPECT_NEAR(parent.at<cv::Vec4b>(10, 10)[2], 200, 3);
  EXPECT_NEAR(parent.at<cv::Vec4b>(10, 200)[0], 200, 3);
  EXPECT_EQ(parent.at<cv::Vec4b>(200, 10)[3], 0);
  EXPECT_EQ(file.Notes().at(tile.Parent()), "a note");
  // What goes, goes everywhere.
  TileFile::Changes none;
  none.tiles[tile] = {};
  none.tiles[{12, 2101, 1400}] = {};
  none.notes[tile.Parent()] = "";
  file.Put(none);
  file.UpdateCoarser(10);
  EXPECT_TRUE(file.Tiles().empty());
  EXPECT_TRUE(file.Notes().empty());
}

TEST(TileFile, IsReadWhileItIsWritten) {
  const ScratchFolder folder;
  TileFile file(folder.File("a.mbtiles"));
  TileFile::Changes changes;
  changes.tiles[{12, 2100, 1400}] = EncodeTile(Plain({0, 0, 200}));
  changes.metadata = {{"name", "test"}, {"frame", "local"}};
  file.Put(changes);
  file.UpdateCoarser(8);
  {
    const TileFile reader(folder.File("a.mbtiles"));
    EXPECT_EQ(reader.Tiles().size(), 5u);
    EXPECT_EQ(reader.Metadata().at("frame"), "local");
  }
  changes.metadata["frame"] = "";
  file.Put(changes);
  file.UpdateCoarser(8);
  EXPECT_FALSE(file.Metadata().contains("frame"));
  EXPECT_EQ(file.AddImage({"session", 3}, {-1, 640, 480, {1, 2}}), 1);
  EXPECT_EQ(file.Images().at({"session", 3}).height, 480);
}

TEST(TileFile, RefusesOtherFiles) {
  const ScratchFolder folder;
  std::ofstream(folder.File("text.mbtiles"))
      << "no database, but long enough to be one, if only it had the right words";
  EXPECT_THROW(TileFile(folder.File("text.mbtiles")), std::runtime_error);
  EXPECT_THROW(TileFile(folder.File("none/a.mbtiles")), std::runtime_error);
}

// What gdalinfo and gdal_translate do.
TEST(TileFile, GdalReadsIt) {
  const ScratchFolder folder;
  {
    TileFile file(folder.File("a.mbtiles"));
    TileFile::Changes changes;
    for (int column = 0; column < 4; ++column) {
      for (int row = 0; row < 4; ++row)
        changes.tiles[{14, 8000 + column, 5000 + row}] = EncodeTile(Plain({30, 160, 90}, row == 0 ? 128 : kTilePixels));
    }
    const double size = TileSize(14);
    const auto longitude = [&](int column) { return (column * size - kHalfWorld) / kHalfWorld * 180; };
    const auto latitude = [&](int row) {
      return std::atan(std::sinh((kHalfWorld - row * size) / kHalfWorld * M_PI)) / M_PI * 180;
    };
    changes.metadata = {{"name", "test"},
                        {"format", "png"},
                        {"minzoom", "10"},
                        {"maxzoom", "14"},
                        {"bounds", std::to_string(longitude(8000)) + "," + std::to_string(latitude(5004)) + "," +
                                       std::to_string(longitude(8004)) + "," + std::to_string(latitude(5000))}};
    file.Put(changes);
    file.UpdateCoarser(10);
  }
  GDALAllRegister();
  GDALDataset* dataset = GDALDataset::Open((folder.File("a.mbtiles")).c_str(), GDAL_OF_RASTER);
  ASSERT_NE(dataset, nullptr);
  char* info = GDALInfo(dataset, nullptr);
  EXPECT_NE(std::string(info).find("EPSG\",3857"), std::string::npos) << info;
  CPLFree(info);
  double transform[6];
  ASSERT_EQ(dataset->GetGeoTransform(transform), CE_None);
  EXPECT_NEAR(transform[1], TilePixelSize(14), 1e-6);
  char* words[] = {const_cast<char*>("-of"), const_cast<char*>("GTiff"), nullptr};
  GDALTranslateOptions* options = GDALTranslateOptionsNew(words, nullptr);
  GDALDataset* copy = GDALDataset::FromHandle(
      GDALTranslate((folder.File("copy.tif")).c_str(), GDALDataset::ToHandle(dataset), options, nullptr));
  GDALTranslateOptionsFree(options);
  ASSERT_NE(copy, nullptr);
  // In the middle of a tile that is full, and of one that is not.
  const auto value = [&](int band, int column, int row) {
    const auto x = static_cast<int>(std::lround((column * TileSize(14) - kHalfWorld - transform[0]) / transform[1]));
    const auto y = static_cast<int>(std::lround((kHalfWorld - row * TileSize(14) - transform[3]) / transform[5]));
    uint8_t pixel = 0;
    EXPECT_EQ(
        copy->GetRasterBand(band)->RasterIO(GF_Read, x + 200, y + 100, 1, 1, &pixel, 1, 1, GDT_Byte, 0, 0, nullptr),
        CE_None);
    return pixel;
  };
  EXPECT_NEAR(value(2, 8001, 5002), 160, 3);
  EXPECT_EQ(value(4, 8001, 5002), 255);
  GDALClose(copy);
  GDALClose(dataset);
}

}  // namespace tile_file_test
}  // namespace mapmend
