#pragma once

#include <deque>

#include "libs/stream/store_questions.h"
#include "libs/stream/submap.h"
#include "procs/submap_store/database.h"
#include "procs/submap_store/derived_tables.h"

namespace mapmend {

// How far a session has come, for a frontend that goes on with it: what is in the file, and what of it is only in
// memory.
//   row      number of the session's row
//   model    its submaps; the open ones in full
//   waiting  submaps that have ended and whose geometry is not in the tables yet
// cumulative and ended are the caller's to fill in.
SessionProgress ReadProgress(Database* database, int64_t row, const Session& model,
                             const std::deque<GeometryWriter>& waiting);

}  // namespace mapmend
