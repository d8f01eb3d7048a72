#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "libs/mosaic/tile_grid.h"

namespace mapmend {

// A tile as a file: JPEG if it is full, else PNG. Empty if nothing is shown.
//   picture  8 bits, 4 channels (BGRA), kTilePixels squared
std::vector<uint8_t> EncodeTile(const cv::Mat& picture);
// Nothing shown if it cannot be decoded.
cv::Mat DecodeTile(const std::vector<uint8_t>& bytes);

// A pyramid of tiles in an SQLite file as the specification of MBTiles 1.3 has it (docs/file_formats.md), which others
// may read while it grows. Beside the tiles it holds notes of who makes them. Functions throw std::runtime_error with
// one line that names the file if it cannot be read or written.
class TileFile {
 public:
  // Opens or makes it. What is no such file is refused.
  explicit TileFile(const std::string& path);
  ~TileFile();  // what SQLite keeps beside the file is gone then, unless somebody reads it
  TileFile(const TileFile&) = delete;
  TileFile& operator=(const TileFile&) = delete;

  struct Changes {
    std::map<TileAddress, std::vector<uint8_t>> tiles;  // of one zoom; empty bytes: the tile goes
    std::map<TileAddress, std::string> notes;           // any text by which their maker knows them; empty: it goes
    std::map<std::string, std::string> metadata;        // by name; empty: it goes
  };
  // In one transaction. The tiles of coarser zooms that these are part of are out of date until UpdateCoarser, which
  // also whoever opens the file later can call.
  void Put(const Changes& changes);
  // Makes those that are out of date, down to min_zoom.
  void UpdateCoarser(int min_zoom);
  // Removes all tiles and notes.
  void Clear();

  std::map<TileAddress, std::string> Notes() const;
  std::map<std::string, std::string> Metadata() const;
  std::optional<std::vector<uint8_t>> Tile(const TileAddress& tile) const;
  std::vector<TileAddress> Tiles() const;  // ascending

  // What is kept of each image, so that none is read twice for it.
  using ImageKey = std::pair<std::string, int>;  // session, keyframe
  struct ImageNote {
    int id = -1;  // given by the file
    int width = 0, height = 0;
    std::vector<uint8_t> brightness;  // PNG
  };
  // Returns its id. Each image once.
  int AddImage(const ImageKey& key, const ImageNote& note);
  std::map<ImageKey, ImageNote> Images() const;
  // It was removed, or replaced by another one.
  bool IsGone() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend
