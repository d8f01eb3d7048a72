#include "procs/viewer_export/mosaic_tiles.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "libs/base/write_file.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace mosaic_tiles_test {

void MakeTiles(const std::string& path) {
  SQLite::Database sql(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  sql.exec("CREATE TABLE metadata(name TEXT, value TEXT)");
  sql.exec("CREATE TABLE tiles(zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB)");
  sql.exec("INSERT INTO metadata VALUES('frame', 'enu')");
  // Zoom 2 has rows 0 to 3 from the south: row 3 is the northernmost.
  sql.exec("INSERT INTO tiles VALUES(2, 1, 3, x'89504E470D0A')");
  sql.exec("INSERT INTO tiles VALUES(3, 2, 0, x'FFD8FFE0')");
}

TEST(MosaicTilesTest, CountsRowsFromTheNorth) {
  const ScratchFolder folder;
  const std::string path = folder.File(kTilesFile);
  MosaicTiles tiles(path);
  EXPECT_EQ(tiles.Tile(2, 1, 0), "") << "no file yet";
  EXPECT_EQ(DescribeTiles(path), "");
  MakeTiles(path);
  EXPECT_STREQ(ImageType(tiles.Tile(2, 1, 0)), "image/png");
  EXPECT_STREQ(ImageType(tiles.Tile(3, 2, 7)), "image/jpeg");
  EXPECT_EQ(tiles.Tile(2, 1, 3), "");
  for (const int wrong : {-1, 4, 1 << 30}) EXPECT_EQ(tiles.Tile(2, 1, wrong), "");
  EXPECT_EQ(tiles.Tile(31, 0, 0), "");
  const nlohmann::json described = nlohmann::json::parse(DescribeTiles(path));
  EXPECT_EQ(described["metadata"]["frame"], "enu");
  EXPECT_EQ(described["min_zoom"], 2);
  EXPECT_EQ(described["max_zoom"], 3);
}

TEST(MosaicTilesTest, LeavesLinksAndStrangersAlone) {
  const ScratchFolder inside, outside;
  MakeTiles(outside.File("secret.db"));
  std::filesystem::create_symlink(outside.File("secret.db"), inside.File(kTilesFile));
  MosaicTiles linked(inside.File(kTilesFile));
  EXPECT_EQ(linked.Tile(2, 1, 0), "");
  EXPECT_EQ(DescribeTiles(inside.File(kTilesFile)), "");
  WriteFile(outside.File(kTilesFile), "no database");
  MosaicTiles damaged(outside.File(kTilesFile));
  EXPECT_EQ(damaged.Tile(0, 0, 0), "");
  EXPECT_EQ(DescribeTiles(outside.File(kTilesFile)), "");
}

}  // namespace mosaic_tiles_test
}  // namespace mapmend
