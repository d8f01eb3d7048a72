#include "libs/mosaic/tile_file.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <sys/stat.h>

#include <array>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace mapmend {
namespace {

constexpr int kApplicationId = 0x4d504258;  // "MPBX", of MBTiles
constexpr int kBusyTimeoutMs = 10000;
constexpr int kJpegQuality = 88;

constexpr char kTables[] = R"sql(
CREATE TABLE metadata(name TEXT, value TEXT);
CREATE UNIQUE INDEX metadata_name ON metadata(name);
CREATE TABLE tiles(zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB);
CREATE UNIQUE INDEX tile_index ON tiles(zoom_level, tile_column, tile_row);
CREATE TABLE mapmend_note(zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, note TEXT NOT NULL,
  PRIMARY KEY(zoom_level, tile_column, tile_row));
CREATE TABLE mapmend_stale(zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER,
  PRIMARY KEY(zoom_level, tile_column, tile_row));
CREATE TABLE mapmend_image(id INTEGER PRIMARY KEY, session TEXT NOT NULL, keyframe INTEGER NOT NULL,
  width INTEGER NOT NULL, height INTEGER NOT NULL, brightness BLOB NOT NULL, UNIQUE(session, keyframe));
)sql";

// MBTiles counts rows from the south.
int FileRow(const TileAddress& tile) { return (1 << tile.zoom) - 1 - tile.row; }

void BindAddress(const TileAddress& tile, SQLite::Statement* statement) {
  statement->bind(1, tile.zoom);
  statement->bind(2, tile.column);
  statement->bind(3, FileRow(tile));
}

TileAddress ReadAddress(SQLite::Statement* row) {
  TileAddress tile{row->getColumn(0).getInt(), row->getColumn(1).getInt(), row->getColumn(2).getInt()};
  tile.row = FileRow(tile);
  return tile;
}

std::vector<uint8_t> ReadBytes(const SQLite::Column& column) {
  const auto* begin = static_cast<const uint8_t*>(column.getBlob());
  return {begin, begin + column.getBytes()};
}

ino_t InodeOf(const std::string& path) {
  struct stat info {};
  return stat(path.c_str(), &info) == 0 ? info.st_ino : 0;
}

// Half the size; a pixel is the mean of those of the four that show anything.
cv::Mat Halved(const cv::Mat& picture) {
  cv::Mat half(picture.rows / 2, picture.cols / 2, CV_8UC4);
  for (int y = 0; y < half.rows; ++y) {
    for (int x = 0; x < half.cols; ++x) {
      std::array<int, 3> sum = {};
      int alpha = 0;
      for (int k = 0; k < 4; ++k) {
        const auto& pixel = picture.at<cv::Vec4b>(2 * y + k / 2, 2 * x + k % 2);
        for (int c = 0; c < 3; ++c) sum[static_cast<size_t>(c)] += pixel[c] * pixel[3];
        alpha += pixel[3];
      }
      auto& pixel = half.at<cv::Vec4b>(y, x);
      for (int c = 0; c < 3; ++c) {
        const int channel = alpha > 0 ? (sum[static_cast<size_t>(c)] + alpha / 2) / alpha : 0;
        pixel[c] = static_cast<uint8_t>(channel);
      }
      constexpr int kOpaque = 255, kTwoOfFour = 510;  // half of it or more counts as shown
      pixel[3] = alpha >= kTwoOfFour ? kOpaque : 0;
    }
  }
  return half;
}

}  // namespace

std::vector<uint8_t> EncodeTile(const cv::Mat& picture) {
  cv::Mat alpha;
  cv::extractChannel(picture, alpha, 3);
  const int num_shown = cv::countNonZero(alpha);
  std::vector<uint8_t> bytes;
  if (num_shown == 0) return bytes;
  if (num_shown == static_cast<int>(alpha.total())) {
    cv::Mat color;
    cv::cvtColor(picture, color, cv::COLOR_BGRA2BGR);
    cv::imencode(".jpg", color, bytes, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  } else {
    cv::imencode(".png", picture, bytes);  // without settings OpenCV takes its fastest
  }
  return bytes;
}

cv::Mat DecodeTile(const std::vector<uint8_t>& bytes) {
  cv::Mat picture = bytes.empty() ? cv::Mat() : cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
  if (picture.channels() == 3) cv::cvtColor(picture, picture, cv::COLOR_BGR2BGRA);
  if (picture.type() != CV_8UC4 || picture.size() != cv::Size(kTilePixels, kTilePixels))
    picture = cv::Mat::zeros(kTilePixels, kTilePixels, CV_8UC4);
  return picture;
}

struct TileFile::Impl {
  const std::string path;
  std::unique_ptr<SQLite::Database> sql;
  ino_t inode = 0;

  template <typename Work>
  auto Guarded(const Work& work) const {
    try {
      return work();
    } catch (const SQLite::Exception& e) {
      throw std::runtime_error(path + ": " + e.what());
    }
  }

  void Open() {
    sql = std::make_unique<SQLite::Database>(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, kBusyTimeoutMs);
    inode = InodeOf(path);
    const bool is_new = sql->execAndGet("SELECT count(*) FROM sqlite_master").getInt() == 0;
    if (!is_new && !sql->tableExists("mapmend_note"))
      throw std::runtime_error(path + ": is not a file of tiles that mapmend has made");
    sql->exec("PRAGMA journal_mode = WAL");
    sql->exec("PRAGMA synchronous = NORMAL");
    if (!is_new) return;
    SQLite::Transaction transaction(*sql);
    sql->exec("PRAGMA application_id = " + std::to_string(kApplicationId));
    sql->exec(kTables);
    transaction.commit();
  }

  void PutTile(const TileAddress& tile, const std::vector<uint8_t>& bytes) {
    SQLite::Statement statement(*sql, bytes.empty() ? "DELETE FROM tiles WHERE zoom_level = ? AND tile_column = ? AND "
                                                      "tile_row = ?"
                                                    : "INSERT OR REPLACE INTO tiles VALUES(?, ?, ?, ?)");
    BindAddress(tile, &statement);
    if (!bytes.empty()) statement.bindNoCopy(4, bytes.data(), static_cast<int>(bytes.size()));
    statement.exec();
  }

  void MarkStale(const TileAddress& tile) {
    SQLite::Statement statement(*sql, "INSERT OR IGNORE INTO mapmend_stale VALUES(?, ?, ?)");
    BindAddress(tile, &statement);
    statement.exec();
  }

  std::set<TileAddress, std::greater<>> Stale() const {
    std::set<TileAddress, std::greater<>> stale;
    SQLite::Statement row(*sql, "SELECT * FROM mapmend_stale");
    while (row.executeStep()) stale.insert(ReadAddress(&row));
    return stale;
  }

  void PutNote(const TileAddress& tile, const std::string& note) {
    SQLite::Statement statement(*sql, note.empty() ? "DELETE FROM mapmend_note WHERE zoom_level = ? AND tile_column = "
                                                     "? AND tile_row = ?"
                                                   : "INSERT OR REPLACE INTO mapmend_note VALUES(?, ?, ?, ?)");
    BindAddress(tile, &statement);
    if (!note.empty()) statement.bind(4, note);
    statement.exec();
  }

  void PutMetadata(const std::string& name, const std::string& value) {
    SQLite::Statement statement(
        *sql, value.empty() ? "DELETE FROM metadata WHERE name = ?" : "INSERT OR REPLACE INTO metadata VALUES(?, ?)");
    statement.bind(1, name);
    if (!value.empty()) statement.bind(2, value);
    statement.exec();
  }

  std::optional<std::vector<uint8_t>> GetTile(const TileAddress& tile) const {
    SQLite::Statement row(*sql,
                          "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?");
    BindAddress(tile, &row);
    if (!row.executeStep()) return std::nullopt;
    return ReadBytes(row.getColumn(0));
  }

  std::vector<uint8_t> MakeFromChildren(const TileAddress& tile) const {
    cv::Mat four = cv::Mat::zeros(2 * kTilePixels, 2 * kTilePixels, CV_8UC4);
    for (int i = 0; i < 4; ++i) {
      const auto child = GetTile(tile.Child(i));
      if (child)
        DecodeTile(*child).copyTo(four(cv::Rect(i % 2 * kTilePixels, i / 2 * kTilePixels, kTilePixels, kTilePixels)));
    }
    return EncodeTile(Halved(four));
  }
};

TileFile::TileFile(const std::string& path) : impl_(std::make_unique<Impl>(Impl{path, nullptr})) {
  impl_->Guarded([&] { impl_->Open(); });
}

TileFile::~TileFile() {
  try {
    impl_->sql->exec("PRAGMA journal_mode = DELETE");
  } catch (const SQLite::Exception&) {
    // Somebody reads it: the next one who opens it cleans up.
  }
}

void TileFile::Put(const Changes& changes) {
  impl_->Guarded([&] {
    SQLite::Transaction transaction(*impl_->sql);
    for (const auto& [tile, bytes] : changes.tiles) {
      impl_->PutTile(tile, bytes);
      if (tile.zoom > 0) impl_->MarkStale(tile.Parent());
    }
    for (const auto& [tile, note] : changes.notes) impl_->PutNote(tile, note);
    for (const auto& [name, value] : changes.metadata) impl_->PutMetadata(name, value);
    transaction.commit();
  });
}

void TileFile::UpdateCoarser(int min_zoom) {
  impl_->Guarded([&] {
    SQLite::Transaction transaction(*impl_->sql);
    // The finest first: each is part of a coarser one.
    std::set<TileAddress, std::greater<>> stale = impl_->Stale();
    while (!stale.empty()) {
      const TileAddress tile = *stale.begin();
      stale.erase(stale.begin());
      if (tile.zoom < min_zoom) continue;
      impl_->PutTile(tile, impl_->MakeFromChildren(tile));
      if (tile.zoom > min_zoom) stale.insert(tile.Parent());
    }
    impl_->sql->exec("DELETE FROM mapmend_stale");
    transaction.commit();
  });
}

void TileFile::Clear() {
  impl_->Guarded([&] {
    SQLite::Transaction transaction(*impl_->sql);
    impl_->sql->exec("DELETE FROM tiles");
    impl_->sql->exec("DELETE FROM mapmend_note");
    impl_->sql->exec("DELETE FROM mapmend_stale");
    transaction.commit();
  });
}

std::map<TileAddress, std::string> TileFile::Notes() const {
  return impl_->Guarded([&] {
    std::map<TileAddress, std::string> notes;
    SQLite::Statement row(*impl_->sql, "SELECT * FROM mapmend_note");
    while (row.executeStep()) notes[ReadAddress(&row)] = row.getColumn(3).getString();
    return notes;
  });
}

std::map<std::string, std::string> TileFile::Metadata() const {
  return impl_->Guarded([&] {
    std::map<std::string, std::string> metadata;
    SQLite::Statement row(*impl_->sql, "SELECT name, value FROM metadata");
    while (row.executeStep()) metadata[row.getColumn(0).getString()] = row.getColumn(1).getString();
    return metadata;
  });
}

std::optional<std::vector<uint8_t>> TileFile::Tile(const TileAddress& tile) const {
  return impl_->Guarded([&] { return impl_->GetTile(tile); });
}

std::vector<TileAddress> TileFile::Tiles() const {
  return impl_->Guarded([&] {
    std::set<TileAddress> tiles;
    SQLite::Statement row(*impl_->sql, "SELECT zoom_level, tile_column, tile_row FROM tiles");
    while (row.executeStep()) tiles.insert(ReadAddress(&row));
    return std::vector<TileAddress>(tiles.begin(), tiles.end());
  });
}

int TileFile::AddImage(const ImageKey& key, const ImageNote& note) {
  return impl_->Guarded([&] {
    SQLite::Statement insert(
        *impl_->sql, "INSERT INTO mapmend_image(session, keyframe, width, height, brightness) VALUES(?, ?, ?, ?, ?)");
    insert.bind(1, key.first);
    insert.bind(2, key.second);
    insert.bind(3, note.width);
    insert.bind(4, note.height);
    insert.bindNoCopy(5, note.brightness.data(), static_cast<int>(note.brightness.size()));
    insert.exec();
    return static_cast<int>(impl_->sql->getLastInsertRowid());
  });
}

std::map<TileFile::ImageKey, TileFile::ImageNote> TileFile::Images() const {
  return impl_->Guarded([&] {
    std::map<ImageKey, ImageNote> images;
    SQLite::Statement row(*impl_->sql, "SELECT * FROM mapmend_image");
    while (row.executeStep()) {
      images[{row.getColumn(1).getString(), row.getColumn(2).getInt()}] = {
          row.getColumn(0).getInt(), row.getColumn(3).getInt(), row.getColumn(4).getInt(), ReadBytes(row.getColumn(5))};
    }
    return images;
  });
}

bool TileFile::IsGone() const { return InodeOf(impl_->path) != impl_->inode; }

}  // namespace mapmend
