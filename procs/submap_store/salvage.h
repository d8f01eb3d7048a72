#pragma once

#include <limits>
#include <map>
#include <string>
#include <vector>

#include "procs/submap_store/database.h"

namespace mapmend {

// Makes a sound database from what is whole in a damaged one, and from other files that hold the same records: step by
// step, so that memory does not grow with the flight. Derived rows and the merged map are not copied.
class Salvage {
 public:
  // `from` was opened with Mode::kDamaged, `into` is new and empty.
  Salvage(Database* from, Database* into);

  // All that is sound in `from`.
  void TakeDatabase();
  // What is still missing of the sessions that the database knows (of any session, if it knows none). The number of
  // records taken.
  int64_t TakeSource(const std::string& path);
  // Writes sessions and gaps; what could not be had goes to lost, a line each.
  void Finish(std::vector<std::string>* lost);

  // A record is there now that the database knew as a gap.
  bool HasFilledGap() const { return filled_gap_; }

 private:
  struct Known {
    int64_t id = 0;
    SessionRow row;  // as the damaged file has it
    std::vector<GapRow> gaps;
    int64_t last = -1;
    int64_t closed_at = std::numeric_limits<int64_t>::max();  // first number that is not its frontend's
  };
  bool Insert(const EncodedRecord& record);
  void GiveName(int64_t id, const std::string& uuid);
  void TakeRows();  // of the record table, where sessions or the index cannot be trusted
  void TakeDecisions(std::vector<std::string>* lost);
  void WriteGap(const GapRow& gap);
  void WriteSession(Known* known, const std::string& uuid, std::vector<std::string>* lost);

  Database* from_;
  Database* into_;
  std::map<std::string, Known> sessions_;
  std::vector<std::string> sources_;
  bool is_open_ = false;  // sessions are not known: any will do
  bool filled_gap_ = false;
};

}  // namespace mapmend
