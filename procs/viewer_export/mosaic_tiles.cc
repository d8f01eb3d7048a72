#include "procs/viewer_export/mosaic_tiles.h"

#include <SQLiteCpp/SQLiteCpp.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>

namespace mapmend {
namespace {

namespace fs = std::filesystem;

constexpr int kBusyMs = 500;  // while a transaction of its maker ends
constexpr int kMaxZoom = 30;
constexpr int kMaxTileBytes = 4 << 20;

// What a symbolic link leads to may lie outside the results.
bool IsPlainFile(const std::string& path) {
  std::error_code error;
  return fs::symlink_status(path, error).type() == fs::file_type::regular && !error;
}

}  // namespace

std::string DescribeTiles(const std::string& path) {
  if (!IsPlainFile(path)) return "";
  try {
    const SQLite::Database sql(path, SQLite::OPEN_READONLY, kBusyMs);
    nlohmann::json metadata = nlohmann::json::object();
    SQLite::Statement row(sql, "SELECT name, value FROM metadata");
    while (row.executeStep()) metadata[row.getColumn(0).getString()] = row.getColumn(1).getString();
    SQLite::Statement zooms(sql, "SELECT min(zoom_level), max(zoom_level) FROM tiles");
    if (!zooms.executeStep() || zooms.getColumn(0).isNull()) return "";
    std::error_code error;
    return nlohmann::json({{"metadata", metadata},
                           {"min_zoom", zooms.getColumn(0).getInt()},
                           {"max_zoom", zooms.getColumn(1).getInt()},
                           // With write-ahead logging new tiles may be in the log alone.
                           {"bytes", fs::file_size(path, error)},
                           {"log_bytes", fs::exists(path + "-wal", error) ? fs::file_size(path + "-wal", error) : 0}})
        .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  } catch (const std::exception&) {
    return "";  // not finished yet, or no such file: the page goes without
  }
}

struct MosaicTiles::Impl {
  std::string path;
  std::mutex mutex;
  std::unique_ptr<SQLite::Database> sql;  // guarded by mutex
};

MosaicTiles::MosaicTiles(const std::string& path) : impl_(std::make_unique<Impl>()) { impl_->path = path; }

MosaicTiles::~MosaicTiles() = default;

std::string MosaicTiles::Tile(int zoom, int x, int y) {
  if (zoom < 0 || zoom > kMaxZoom || x < 0 || y < 0 || x >= 1 << zoom || y >= 1 << zoom) return "";
  const std::lock_guard lock(impl_->mutex);
  try {
    if (!impl_->sql) {
      if (!IsPlainFile(impl_->path)) return "";
      impl_->sql = std::make_unique<SQLite::Database>(impl_->path, SQLite::OPEN_READONLY, kBusyMs);
    }
    SQLite::Statement row(*impl_->sql,
                          "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?");
    row.bind(1, zoom);
    row.bind(2, x);
    row.bind(3, (1 << zoom) - 1 - y);  // MBTiles counts rows from the south
    if (!row.executeStep() || row.getColumn(0).getBytes() > kMaxTileBytes) return "";
    return {static_cast<const char*>(row.getColumn(0).getBlob()), static_cast<size_t>(row.getColumn(0).getBytes())};
  } catch (const std::exception&) {
    impl_->sql.reset();  // replaced, perhaps
    return "";
  }
}

const char* ImageType(const std::string& bytes) {
  if (bytes.starts_with("\x89PNG")) return "image/png";
  if (bytes.starts_with("\xff\xd8")) return "image/jpeg";
  if (bytes.starts_with("RIFF") && bytes.size() > 12 && bytes.compare(8, 4, "WEBP") == 0) return "image/webp";
  return "application/octet-stream";
}

}  // namespace mapmend
