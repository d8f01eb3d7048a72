#include <sys/stat.h>

#include <cstdio>

#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/submap_store.h"

namespace mapmend {
namespace {

int64_t FileSize(const std::string& path) {
  struct stat info {};
  return stat(path.c_str(), &info) == 0 ? info.st_size : 0;
}

}  // namespace

void CompactDb(const std::string& path) {
  const int64_t before = FileSize(path);
  if (before == 0) throw std::runtime_error(path + ": no such database");
  {
    // Opening as the store does migrates it and writes what a killed store left open.
    SubmapStoreOptions options;
    options.path = path;
    SubmapStore store(options);
    while (store.WorkInBackground()) continue;
  }
  Database database(path, Database::Mode::kReadWrite);
  database.Sql().exec("VACUUM");
  database.Sql().exec("PRAGMA wal_checkpoint(TRUNCATE)");
  std::printf("%s: %lld bytes, were %lld\n", path.c_str(), static_cast<long long>(FileSize(path)),
              static_cast<long long>(before));
}

}  // namespace mapmend
