#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>

// The tables of a map database (docs/file_formats.md explains every column). The record table is the flight: everything
// else of the stream is derived from it and can be made again from it.
namespace mapmend {

inline constexpr int32_t kApplicationId = 0x4d4d4150;  // "MMAP", in the file's header
inline constexpr int kSchemaVersion = 6;               // PRAGMA user_version

// Brings a database from the version it has (0: empty) to `version` (of at most kSchemaVersion), one transaction per
// step.
void Migrate(SQLite::Database* database, int version = kSchemaVersion);

}  // namespace mapmend
