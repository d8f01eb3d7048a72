#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

namespace mapmend {

// Adds the SQL function row_checksum(...) to a connection: CRC-32 over its arguments in order, integers as decimal
// text, each text (and integer, and NULL as none) followed by a zero byte, blobs as they are. Of (channel, payload) it
// is RecordChecksum.
void AddRowChecksum(SQLite::Database* database);

}  // namespace mapmend
