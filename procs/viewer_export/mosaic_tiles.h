#pragma once

#include <memory>
#include <mutex>
#include <string>

namespace mapmend {

// The picture of the ground as tiles: an SQLite file after the MBTiles 1.3 specification, that may grow meanwhile.
inline constexpr char kTilesFile[] = "mosaic.mbtiles";

// Its metadata as one JSON object of texts, with the number of its changes; empty if there is no such file.
std::string DescribeTiles(const std::string& path);

// Reads tiles, one at a time; thread-safe. A file that is not there yet is looked for again.
class MosaicTiles {
 public:
  explicit MosaicTiles(const std::string& path);
  ~MosaicTiles();
  // A PNG, JPEG or WebP file; empty if there is none. y counts from the north, as web maps do.
  std::string Tile(int zoom, int x, int y);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// "image/png" and so on, by the first bytes.
const char* ImageType(const std::string& bytes);

}  // namespace mapmend
