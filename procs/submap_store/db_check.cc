#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/submap_model.h"

namespace mapmend {
namespace {

// Follows the records of one session as a consumer does.
void CheckSession(Database* database, const SessionRow& session, std::vector<std::string>* problems) {
  const auto report = [&](int64_t seq, const std::string& what) {
    problems->push_back("session " + session.uuid + ", record " + std::to_string(seq) + ": " + what);
  };
  const std::vector<GapRow> gaps = database->Gaps(session.id);
  size_t gap = 0;
  int64_t expected = 0, num_keyframes = 0;
  Session model;
  const auto skip_gaps = [&] {
    while (gap < gaps.size() && gaps[gap].first_seq == expected) expected = gaps[gap++].last_seq + 1;
  };
  database->ReadRecords(session, 0, session.cumulative, [&](const EncodedRecord& encoded) {
    skip_gaps();
    if (encoded.seq != expected) report(expected, "is missing and not in the gap table");
    expected = encoded.seq + 1;
    const DecodedRecord decoded =
        DecodeRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()));
    if (!decoded.record) {
      report(encoded.seq, decoded.error);
      return true;
    }
    if (decoded.record->header.session != session.uuid || decoded.record->header.seq != encoded.seq) {
      report(encoded.seq, "its payload names another record");
    }
    if (const std::string error = ApplyLight(*decoded.record, &model); !error.empty()) report(encoded.seq, error);
    if (std::holds_alternative<KeyframeRecord>(decoded.record->body)) ++num_keyframes;
    if (const auto* end = std::get_if<SubmapEnded>(&decoded.record->body)) {
      Submap stub;  // nothing refers to it any more
      stub.ended = true;
      model.submaps[end->submap] = std::move(stub);
    }
    return true;
  });
  if (model.ended != session.ended)
    report(session.cumulative, "the session table and the records disagree about its end");
  auto count = database->Prepare(
      "SELECT count(*), (SELECT count(*) FROM keyframe_bow WHERE session = ?1) FROM keyframe WHERE session = ?1");
  count->bind(1, session.id);
  if (count->executeStep() &&
      (count->getColumn(0).getInt64() != num_keyframes || count->getColumn(1).getInt64() != num_keyframes)) {
    problems->push_back("session " + session.uuid + ": " + std::to_string(num_keyframes) +
                        " keyframe records, but another number of rows in keyframe or keyframe_bow");
  }
}

}  // namespace

std::vector<std::string> CheckDb(const std::string& path) {
  Database database(path, Database::Mode::kReadOnly);
  std::vector<std::string> problems;
  {
    auto integrity = database.Prepare("PRAGMA integrity_check");
    while (integrity->executeStep()) {
      const std::string line = integrity->getColumn(0).getString();
      if (line != "ok") problems.push_back(path + ": " + line);
    }
  }
  if (!problems.empty()) return problems;  // pages that cannot be trusted are not worth reading on
  for (const SessionRow& session : database.Sessions()) CheckSession(&database, session, &problems);
  return problems;
}

}  // namespace mapmend
