#include "libs/images/image_file.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <sys/stat.h>

#include <filesystem>
#include <map>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "libs/base/checksum.h"

namespace mapmend {
namespace {

constexpr int kApplicationId = 0x4d4d494d;  // "MMIM"
constexpr int kVersion = 1;
constexpr int kBusyTimeoutMs = 10000;

// The checksum stands before the bytes: what is listed is read without them.
constexpr char kTable[] = R"sql(
CREATE TABLE image(
  session TEXT NOT NULL,
  keyframe INTEGER NOT NULL,
  frame INTEGER NOT NULL,
  utime INTEGER NOT NULL,
  width INTEGER NOT NULL,
  height INTEGER NOT NULL,
  encoding TEXT NOT NULL,
  checksum INTEGER NOT NULL,
  bytes BLOB NOT NULL,
  PRIMARY KEY(session, keyframe)
);
)sql";

using Key = std::pair<std::string, KeyframeId>;

// Of all columns, in the manner of the map database: numbers as text, each value but the bytes followed by a zero.
uint32_t ChecksumOf(const KeyframeImage& image) {
  std::string text = image.session + '\0';
  for (const int64_t number :
       {int64_t{image.keyframe.value}, int64_t{image.frame}, image.utime, int64_t{image.width}, int64_t{image.height}})
    text += std::to_string(number) + '\0';
  text += image.encoding + '\0';
  return Crc32(image.bytes.data(), image.bytes.size(), Crc32(text.data(), text.size()));
}

ino_t InodeOf(const std::string& path) {
  struct stat info {};
  return stat(path.c_str(), &info) == 0 ? info.st_ino : 0;
}

KeyframeImage ReadRow(SQLite::Statement* row, uint32_t* checksum) {
  KeyframeImage image;
  image.session = row->getColumn(0).getString();
  image.keyframe = KeyframeId(row->getColumn(1).getInt());
  image.frame = row->getColumn(2).getInt();
  image.utime = row->getColumn(3).getInt64();
  image.width = row->getColumn(4).getInt();
  image.height = row->getColumn(5).getInt();
  image.encoding = row->getColumn(6).getString();
  *checksum = static_cast<uint32_t>(row->getColumn(7).getInt64());
  const SQLite::Column bytes = row->getColumn(8);
  const auto* begin = static_cast<const uint8_t*>(bytes.getBlob());
  image.bytes.assign(begin, begin + bytes.getBytes());
  return image;
}

}  // namespace

struct ImageFile::Impl {
  const std::string path;
  mutable std::mutex mutex;
  std::unique_ptr<SQLite::Database> sql;  // null: there is no file yet
  std::map<Key, Entry> entries;
  ino_t inode = 0;

  template <typename Work>
  auto Guarded(const Work& work) const {
    const std::lock_guard lock(mutex);
    try {
      return work();
    } catch (const SQLite::Exception& e) {
      throw std::runtime_error(path + ": " + e.what());
    }
  }

  Impl(const std::string& p, Mode mode) : path(p) {
    const bool exists = std::filesystem::exists(path);
    if (!exists && mode == Mode::kReadOnly) throw std::runtime_error(path + ": there is no such file");
    if (exists) Guarded([&] { Open(mode); });
  }

  void Open(Mode mode) {
    const bool writes = mode == Mode::kReadWrite;
    sql = std::make_unique<SQLite::Database>(
        path, writes ? SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE : SQLite::OPEN_READONLY, kBusyTimeoutMs);
    inode = InodeOf(path);
    const bool is_new = sql->execAndGet("SELECT count(*) FROM sqlite_master").getInt() == 0;
    if (!is_new && sql->execAndGet("PRAGMA application_id").getInt() != kApplicationId)
      throw std::runtime_error(path + ": holds no images of keyframes (an SQLite file of something else)");
    if (!is_new && sql->execAndGet("PRAGMA user_version").getInt() > kVersion)
      throw std::runtime_error(path + ": is of a newer version; use a newer mapmend");
    if (is_new && !writes) return;
    if (is_new) sql->exec("PRAGMA page_size = 16384");  // rows are large
    if (writes) {
      sql->exec("PRAGMA journal_mode = WAL");
      sql->exec("PRAGMA synchronous = FULL");
    }
    if (is_new) {
      SQLite::Transaction transaction(*sql);
      sql->exec("PRAGMA application_id = " + std::to_string(kApplicationId));
      sql->exec("PRAGMA user_version = " + std::to_string(kVersion));
      sql->exec(kTable);
      transaction.commit();
    }
    SQLite::Statement rows(*sql, "SELECT session, keyframe, frame, length(bytes) FROM image");
    while (rows.executeStep()) {
      Entry entry{rows.getColumn(0).getString(), KeyframeId(rows.getColumn(1).getInt()), rows.getColumn(2).getInt(),
                  rows.getColumn(3).getInt64()};
      entries[{entry.session, entry.keyframe}] = std::move(entry);
    }
  }

  void Insert(const KeyframeImage& image) {
    SQLite::Statement insert(*sql, "INSERT OR REPLACE INTO image VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)");
    insert.bind(1, image.session);
    insert.bind(2, image.keyframe.value);
    insert.bind(3, image.frame);
    insert.bind(4, static_cast<int64_t>(image.utime));
    insert.bind(5, image.width);
    insert.bind(6, image.height);
    insert.bind(7, image.encoding);
    insert.bind(8, static_cast<int64_t>(ChecksumOf(image)));
    insert.bindNoCopy(9, image.bytes.data(), static_cast<int>(image.bytes.size()));
    insert.exec();
  }
};

ImageFile::ImageFile(const std::string& path, Mode mode) : impl_(std::make_unique<Impl>(path, mode)) {}

ImageFile::~ImageFile() = default;

const std::string& ImageFile::Path() const { return impl_->path; }

std::vector<ImageFile::Entry> ImageFile::List() const {
  const std::lock_guard lock(impl_->mutex);
  std::vector<Entry> list;
  for (const auto& [key, entry] : impl_->entries) list.push_back(entry);
  return list;
}

std::optional<ImageFile::Entry> ImageFile::Find(const std::string& session, KeyframeId keyframe) const {
  const std::lock_guard lock(impl_->mutex);
  const auto it = impl_->entries.find({session, keyframe});
  return it == impl_->entries.end() ? std::nullopt : std::optional(it->second);
}

std::optional<KeyframeImage> ImageFile::Get(const std::string& session, KeyframeId keyframe) const {
  return impl_->Guarded([&]() -> std::optional<KeyframeImage> {
    if (!impl_->entries.contains({session, keyframe})) return std::nullopt;  // so there is a file
    SQLite::Statement row(*impl_->sql, "SELECT * FROM image WHERE session = ? AND keyframe = ?");
    row.bind(1, session);
    row.bind(2, keyframe.value);
    if (!row.executeStep()) return std::nullopt;
    uint32_t checksum = 0;
    KeyframeImage image = ReadRow(&row, &checksum);
    if (checksum != ChecksumOf(image)) return std::nullopt;
    return image;
  });
}

void ImageFile::Put(const std::vector<KeyframeImage>& images) {
  impl_->Guarded([&] {
    if (!impl_->sql) impl_->Open(Mode::kReadWrite);
    SQLite::Transaction transaction(*impl_->sql);
    for (const KeyframeImage& image : images) impl_->Insert(image);
    transaction.commit();
    for (const KeyframeImage& image : images) {
      impl_->entries[{image.session, image.keyframe}] = {image.session, image.keyframe, image.frame,
                                                         static_cast<int64_t>(image.bytes.size())};
    }
  });
}

void ImageFile::Remove(const std::string& session, const std::vector<KeyframeId>& keyframes) {
  impl_->Guarded([&] {
    if (!impl_->sql) return;
    SQLite::Transaction transaction(*impl_->sql);
    for (const KeyframeId keyframe : keyframes) {
      if (impl_->entries.erase({session, keyframe}) == 0) continue;
      SQLite::Statement remove(*impl_->sql, "DELETE FROM image WHERE session = ? AND keyframe = ?");
      remove.bind(1, session);
      remove.bind(2, keyframe.value);
      remove.exec();
    }
    transaction.commit();
  });
}

void ImageFile::Compact() {
  impl_->Guarded([&] {
    if (!impl_->sql) return;
    impl_->sql->exec("VACUUM");
    impl_->sql->exec("PRAGMA wal_checkpoint(TRUNCATE)");
  });
}

std::vector<std::string> ImageFile::Check() const {
  return impl_->Guarded([&] {
    std::vector<std::string> problems;
    if (!impl_->sql) return problems;
    SQLite::Statement integrity(*impl_->sql, "PRAGMA integrity_check");
    while (integrity.executeStep()) {
      const std::string line = integrity.getColumn(0).getString();
      if (line != "ok") problems.push_back(impl_->path + ": " + line);
    }
    SQLite::Statement rows(*impl_->sql, "SELECT * FROM image ORDER BY session, keyframe");
    while (!impl_->entries.empty() && rows.executeStep()) {
      uint32_t checksum = 0;
      const KeyframeImage image = ReadRow(&rows, &checksum);
      if (checksum == ChecksumOf(image)) continue;
      problems.push_back(impl_->path + ": session " + image.session + ", image of keyframe " +
                         std::to_string(image.keyframe.value) + ": its checksum does not fit");
    }
    return problems;
  });
}

bool ImageFile::IsGone() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->sql && InodeOf(impl_->path) != impl_->inode;
}

std::string ImagePathFor(const std::string& database) {
  std::filesystem::path path(database);
  const bool is_usual = path.filename() == "map.db";
  path.replace_filename(is_usual ? "images.db" : path.stem().string() + ".images.db");
  return path.string();
}

std::string SpoolPathFor(const std::string& outbox) { return outbox + ".images"; }

void RemoveImageFile(const std::string& path) {
  std::error_code ignored;
  for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path + suffix, ignored);
}

}  // namespace mapmend
