#include <filesystem>
#include <stdexcept>

#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"

namespace mapmend {

void ForgetMergedMap(const std::string& path) {
  if (!std::filesystem::exists(path)) throw std::runtime_error(path + ": no such database");
  Database database(path, Database::Mode::kReadWrite);
  SQLite::Transaction transaction(database.Sql());
  for (const char* table : {"revision", "revision_part", "merged_submap", "connection"}) {
    database.Sql().exec(std::string("DELETE FROM ") + table);
  }
  transaction.commit();
}

}  // namespace mapmend
