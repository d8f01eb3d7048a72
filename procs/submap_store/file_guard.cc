#include "procs/submap_store/file_guard.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <stdexcept>

#include "procs/submap_store/schema.h"

namespace mapmend {
namespace {

// Offsets in the header of an SQLite file (https://www.sqlite.org/fileformat.html, section 1.3); numbers are
// big-endian.
constexpr int kHeaderSize = 100, kPageSizeAt = 16, kPageCountAt = 28, kUserVersionAt = 60, kApplicationIdAt = 68;

uint32_t ReadU32(const uint8_t* p) {
  return static_cast<uint32_t>(p[0]) << 24 | static_cast<uint32_t>(p[1]) << 16 | static_cast<uint32_t>(p[2]) << 8 |
         p[3];
}

// Empty if the file can be opened, else what is wrong with it.
std::string Inspect(int fd, const std::string& path) {
  struct stat info {};
  if (fstat(fd, &info) != 0) return std::strerror(errno);
  if (!S_ISREG(info.st_mode)) return "is not a regular file";
  if (info.st_size == 0) return "";
  uint8_t header[kHeaderSize];
  if (pread(fd, header, kHeaderSize, 0) != kHeaderSize || std::memcmp(header, "SQLite format 3", 16) != 0) {
    return "is not a map database (no SQLite file)";
  }
  // Of a new database, version and id may still be in the write-ahead log only.
  struct stat wal {};
  const bool has_wal = stat((path + "-wal").c_str(), &wal) == 0 && wal.st_size > 0;
  const uint32_t application_id = ReadU32(header + kApplicationIdAt), version = ReadU32(header + kUserVersionAt);
  if (application_id != static_cast<uint32_t>(kApplicationId) && !(has_wal && application_id == 0)) {
    return "is not a map database (an SQLite file of another program)";
  }
  if (version > static_cast<uint32_t>(kSchemaVersion)) {
    return "has schema version " + std::to_string(version) + ", this program knows up to " +
           std::to_string(kSchemaVersion) + "; use a newer mapmend";
  }
  const int64_t page_size = header[kPageSizeAt] == 0 && header[kPageSizeAt + 1] == 1
                                ? 65536
                                : static_cast<int64_t>(header[kPageSizeAt]) << 8 | header[kPageSizeAt + 1];
  const int64_t expected = page_size * ReadU32(header + kPageCountAt);
  if (!has_wal && info.st_size < expected) {
    return "is truncated: " + std::to_string(info.st_size) + " of " + std::to_string(expected) + " bytes are left";
  }
  return "";
}

}  // namespace

FileGuard::FileGuard(const std::string& path, Access access) : path_(path) {
  const bool exclusive = access == Access::kExclusive;
  fd_ = open(path.c_str(), (exclusive ? O_RDWR | O_CREAT : O_RDONLY) | O_CLOEXEC, 0644);
  if (fd_ < 0) throw std::runtime_error(path + ": " + std::strerror(errno));
  std::string error;
  if (exclusive && flock(fd_, LOCK_EX | LOCK_NB) != 0) {
    error = "is in use by another submap_store or tool";
  } else if (access != Access::kSharedUnseen) {
    error = Inspect(fd_, path);
  }
  if (error.empty()) {
    struct stat info {};
    if (access == Access::kShared && fstat(fd_, &info) == 0 && info.st_size == 0) error = "is empty";
    struct stat wal {};
    const bool has_wal = stat((path + "-wal").c_str(), &wal) == 0 && wal.st_size > 0;
    is_at_rest_ = !exclusive && !has_wal && flock(fd_, LOCK_SH | LOCK_NB) == 0;
  }
  if (!error.empty()) {
    close(fd_);
    throw std::runtime_error(path + ": " + error);
  }
}

FileGuard::~FileGuard() { close(fd_); }

FileGuard::Place FileGuard::Look() const {
  struct stat opened {
  }, there{};
  if (stat(path_.c_str(), &there) != 0) return errno == ENOENT || errno == ENOTDIR ? Place::kNone : Place::kSame;
  const bool is_same = fstat(fd_, &opened) == 0 && opened.st_dev == there.st_dev && opened.st_ino == there.st_ino;
  return is_same ? Place::kSame : Place::kOther;
}

}  // namespace mapmend
