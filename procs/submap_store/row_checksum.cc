#include "procs/submap_store/row_checksum.h"

#include <sqlite3.h>

#include "libs/base/checksum.h"

namespace mapmend {

void AddRowChecksum(SQLite::Database* database) {
  const auto function = [](sqlite3_context* context, int num_values, sqlite3_value** values) {
    uint32_t checksum = 0;
    for (int i = 0; i < num_values; ++i) {
      const bool is_blob = sqlite3_value_type(values[i]) == SQLITE_BLOB;
      const void* bytes = is_blob ? sqlite3_value_blob(values[i]) : sqlite3_value_text(values[i]);
      if (bytes != nullptr) checksum = Crc32(bytes, static_cast<size_t>(sqlite3_value_bytes(values[i])), checksum);
      if (!is_blob) checksum = Crc32("", 1, checksum);
    }
    sqlite3_result_int64(context, checksum);
  };
  database->createFunction("row_checksum", -1, true, nullptr, function, nullptr, nullptr, nullptr);
}

}  // namespace mapmend
