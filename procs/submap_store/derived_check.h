#pragma once

#include <string>
#include <vector>

#include "libs/stream/submap.h"
#include "procs/submap_store/database.h"

namespace mapmend {

// Makes the derived rows of a database anew, from its records, in a scratch database, and compares the two row by row:
// damage in what carries no checksum of its own is seen too.
class DerivedCheck {
 public:
  explicit DerivedCheck(Database* database) : database_(database), scratch_("", Database::Mode::kScratch) {}

  // The records of a session one by one, then its end: what does not fit goes to problems, one line per table.
  void OnRecord(const SessionRow& session, const Record& record);
  void OnSubmapEnded(const SessionRow& session, Submap submap);
  void FinishSession(const SessionRow& session, std::vector<std::string>* problems);

  // The rows made from a stored revision, then all of them.
  void OnRevision(const std::vector<uint8_t>& payload);
  void FinishRevisions(std::vector<std::string>* problems);

  // Tables, columns and indices are those of the schema.
  void CheckSchema(std::vector<std::string>* problems);

 private:
  void Compare(const std::string& what, const std::string& table, const std::string& query, int64_t session,
               std::vector<std::string>* problems);

  Database* database_;
  Database scratch_;
};

}  // namespace mapmend
