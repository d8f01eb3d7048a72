#pragma once

#include <mapmend/edge_decisions_t.hpp>
#include <mapmend/edge_request_t.hpp>
#include <vector>

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
  edge_decisions_t Decide(const edge_request_t& request);
  // All, oldest first.
  std::vector<edge_decision_t> All();

 private:
  Database* database_;
};

}  // namespace mapmend
