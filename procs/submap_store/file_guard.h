#pragma once

#include <string>

namespace mapmend {

// Looks at a database file before SQLite touches it, and keeps other processes off it.
class FileGuard {
 public:
  enum class Access {
    kShared,        // reading; a store may be running on it
    kSharedUnseen,  // reading what may be damaged: only a file that cannot be opened is refused
    kExclusive,     // the one that writes; created if absent
  };

  // Throws std::runtime_error with one line that names the file, and leaves it as it was, if it is missing (kShared),
  // truncated, not a map database, of a newer version, or in use by another writer.
  FileGuard(const std::string& path, Access access);
  ~FileGuard();
  FileGuard(const FileGuard&) = delete;
  FileGuard& operator=(const FileGuard&) = delete;

  // kShared: nobody writes it and no write-ahead log is left, so that SQLite need not make any files beside it to read
  // it.
  bool IsAtRest() const { return is_at_rest_; }
  // Whether the path still leads to the file that was opened, to another one, or to none.
  enum class Place { kSame, kOther, kNone };
  Place Look() const;

 private:
  // Held to the end: closing any descriptor of the file would drop SQLite's own locks on it. So a FileGuard must
  // outlive the connections.
  int fd_ = -1;
  const std::string path_;
  bool is_at_rest_ = false;
};

}  // namespace mapmend
