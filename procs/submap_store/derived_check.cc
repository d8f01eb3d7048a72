#include "procs/submap_store/derived_check.h"

#include <utility>

#include "procs/submap_store/derived_tables.h"
#include "procs/submap_store/revision_store.h"

namespace mapmend {
namespace {

// What one row holds, kind and bytes of each column.
std::string RowContent(SQLite::Statement* row) {
  std::string content;
  for (int i = 0; i < row->getColumnCount(); ++i) {
    const SQLite::Column column = row->getColumn(i);
    content += static_cast<char>('0' + column.getType());
    const std::string text = column.getString();
    content += std::to_string(text.size()) + ":" + text;
  }
  return content;
}

}  // namespace

void DerivedCheck::OnRecord(const SessionRow& session, const Record& record) {
  if (const auto* start = std::get_if<SessionStarted>(&record.body)) {
    const int64_t id = InsertSession(&scratch_, record.header, *start);
    auto number = scratch_.Prepare("UPDATE session SET id = ? WHERE id = ?");
    number->bind(1, session.id);
    number->bind(2, id);
    number->exec();
  }
  WriteDerivedRows(&scratch_, session.id, record);
}

void DerivedCheck::OnSubmapEnded(const SessionRow& session, Submap submap) {
  GeometryWriter writer(session.id, std::move(submap));
  while (!writer.Step(&scratch_)) continue;
}

void DerivedCheck::Compare(const std::string& what, const std::string& table, const std::string& query, int64_t session,
                           std::vector<std::string>* problems) {
  int num_wrong = 0;
  std::string reason = "do not fit the records";
  try {
    auto ours = database_->Prepare(query), made = scratch_.Prepare(query);
    if (session >= 0) ours->bind(1, session), made->bind(1, session);
    bool more_ours = ours->executeStep(), more_made = made->executeStep();
    while (more_ours || more_made) {
      if (more_ours != more_made || RowContent(ours.get()) != RowContent(made.get())) ++num_wrong;
      more_ours = more_ours && ours->executeStep();
      more_made = more_made && made->executeStep();
    }
  } catch (const SQLite::Exception& e) {
    if (!IsDamage(e)) throw;
    ++num_wrong;
    reason = std::string("cannot be read: ") + e.what();
  }
  if (num_wrong > 0) problems->push_back(what + ": rows of the table " + table + " " + reason);
}

void DerivedCheck::FinishSession(const SessionRow& session, std::vector<std::string>* problems) {
  // The store writes the geometry of a submap when it has time: one that it has not done yet is compared without.
  {
    auto undone = database_->Prepare("SELECT submap FROM submap WHERE session = ? AND NOT has_geometry");
    undone->bind(1, session.id);
    while (undone->executeStep()) {
      auto forget = scratch_.Prepare(
          "UPDATE submap SET has_geometry = 0, num_keyframes = NULL, num_points = NULL, num_frames = NULL, frames = "
          "NULL WHERE session = ? AND submap = ?");
      forget->bind(1, session.id);
      forget->bind(2, undone->getColumn(0).getInt64());
      forget->exec();
    }
  }
  const std::string what = "session " + session.uuid;
  Compare(what, "session", "SELECT * FROM session WHERE id = ?", session.id, problems);
  Compare(what, "submap", "SELECT * FROM submap WHERE session = ? ORDER BY submap", session.id, problems);
  Compare(what, "keyframe", "SELECT * FROM keyframe WHERE session = ? ORDER BY keyframe", session.id, problems);
  Compare(what, "keyframe_bow", "SELECT * FROM keyframe_bow WHERE session = ? ORDER BY keyframe", session.id, problems);
  Compare(what, "keyframe_geometry",
          "SELECT g.* FROM keyframe_geometry g JOIN keyframe USING (session, keyframe) JOIN submap USING (session, "
          "submap) WHERE session = ? AND has_geometry ORDER BY g.keyframe",
          session.id, problems);
  Compare(what, "map_points",
          "SELECT p.* FROM map_points p JOIN submap USING (session, submap) WHERE session = ? AND has_geometry ORDER "
          "BY p.submap, chunk",
          session.id, problems);
}

void DerivedCheck::OnRevision(const std::vector<uint8_t>& payload) {
  RevisionStore(&scratch_).Store(payload.data(), static_cast<int>(payload.size()));
}

void DerivedCheck::FinishRevisions(std::vector<std::string>* problems) {
  Compare("merged map", "merged_submap", "SELECT * FROM merged_submap ORDER BY revision, session, submap", -1,
          problems);
  Compare("merged map", "connection", "SELECT * FROM connection ORDER BY revision, rowid", -1, problems);
}

void DerivedCheck::CheckSchema(std::vector<std::string>* problems) {
  Compare("schema", "sqlite_master", "SELECT type, name, tbl_name, sql FROM sqlite_master ORDER BY type, name", -1,
          problems);
}

}  // namespace mapmend
