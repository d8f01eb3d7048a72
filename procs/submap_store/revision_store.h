#pragma once

#include <cstdint>
#include <optional>

#include "libs/stream/store_questions.h"
#include "procs/submap_store/database.h"

namespace mapmend {

// Revisions of the merged map, as the merger made them. Every revision's transforms and connections are kept, the
// refined keyframes and points only of the newest complete revision and of those after it.
class RevisionStore {
 public:
  explicit RevisionStore(Database* database) : database_(database) {}

  // Commit one message and return its acknowledgement; nullopt if it is not valid. Storing a head under a number
  // that is in use replaces what was there, unless it is the same. Throw SQLite::Exception, e.g. on a full disk.
  std::optional<RevisionAck> Store(const uint8_t* data, int size);
  std::optional<RevisionAck> StorePart(const uint8_t* data, int size);

  RevisionAnswer Fetch(const RevisionRequest& request);
  // The newest revision whose parts are all there; -1: none.
  int64_t NewestComplete();

 private:
  Database* database_;
};

}  // namespace mapmend
