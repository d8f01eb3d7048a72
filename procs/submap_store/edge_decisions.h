#pragma once

#include <vector>

#include "libs/stream/store_questions.h"
#include "procs/submap_store/database.h"

namespace mapmend {

// What people decided about connections. Together with the stream it is all that the merged map depends on, so it is
// kept in the order in which it was said, and nothing of it is ever removed.
class EdgeDecisions {
 public:
  explicit EdgeDecisions(Database* database) : database_(database) {}

  // Commits the request's decisions that change something, then answers with all. Throws std::runtime_error if a
  // decision names no possible pair of submaps (none of the request is kept then), SQLite::Exception e.g. on a full
  // disk.
  EdgeAnswer Decide(const EdgeRequest& request);
  // All, oldest first.
  std::vector<EdgeDecision> All();

 private:
  Database* database_;
};

}  // namespace mapmend
