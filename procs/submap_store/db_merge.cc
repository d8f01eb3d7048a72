#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <set>
#include <stdexcept>

#include "libs/base/text_format.h"
#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"

namespace mapmend {
namespace {

struct Source {
  std::string path;
  SessionRow session;
};

const char* const kTables[] = {"record",    "gap", "submap", "keyframe", "keyframe_bow", "keyframe_geometry",
                               "map_points"};

// Names of a table's columns but `session`, which is numbered anew.
std::string Columns(SQLite::Database* database, const std::string& table) {
  SQLite::Statement info(*database,
                         "SELECT name FROM pragma_table_info('" + table + "') WHERE name NOT IN ('session', 'id')");
  std::string columns;
  while (info.executeStep()) columns += std::string(columns.empty() ? "" : ", ") + info.getColumn(0).getText();
  return columns;
}

void CopySession(SQLite::Database* out, const Source& source) {
  SQLite::Statement attach(*out, "ATTACH DATABASE ? AS source");
  attach.bind(1, source.path);
  attach.exec();
  {
    SQLite::Transaction transaction(*out);
    const std::string columns = Columns(out, "session");
    SQLite::Statement session(
        *out, "INSERT INTO main.session(" + columns + ") SELECT " + columns + " FROM source.session WHERE id = ?");
    session.bind(1, source.session.id);
    session.exec();
    const int64_t id = out->getLastInsertRowid();
    for (const char* table : kTables) {
      const std::string names = Columns(out, table);
      SQLite::Statement copy(
          *out, Format("INSERT INTO main.%s(session, %s) SELECT ?, %s FROM source.%s WHERE session = ?", table,
                       names.c_str(), names.c_str(), table));
      copy.bind(1, id);
      copy.bind(2, source.session.id);
      copy.exec();
    }
    transaction.commit();
  }
  out->exec("DETACH DATABASE source");
}

// The decisions of each file hold for its own sessions, so their order among the files does not matter.
void CopyEdgeDecisions(SQLite::Database* out, const std::string& path) {
  SQLite::Statement attach(*out, "ATTACH DATABASE ? AS source");
  attach.bind(1, path);
  attach.exec();
  const std::string columns = "session_a, submap_a, session_b, submap_b, disabled";
  // Their numbers, which the checksum covers, are new.
  const std::string number =
      "(SELECT ifnull(max(number), 0) FROM main.edge_decision) + row_number() OVER (ORDER BY number)";
  out->exec("INSERT INTO main.edge_decision(number, " + columns + ", checksum) SELECT n, " + columns +
            ", row_checksum(n, " + columns + ") FROM (SELECT " + number + " AS n, " + columns +
            " FROM source.edge_decision)");
  out->exec("DETACH DATABASE source");
}

}  // namespace

void MergeDbs(const std::vector<std::string>& inputs, const std::string& out) {
  if (std::filesystem::exists(out)) throw std::runtime_error(out + ": exists already; name a new file");
  std::vector<Source> sources;
  std::vector<std::unique_ptr<Database>> open;  // checked, and of the newest schema
  for (const std::string& path : inputs) {
    open.push_back(std::make_unique<Database>(path, Database::Mode::kReadOnly));
    for (SessionRow& session : open.back()->Sessions()) sources.push_back({path, std::move(session)});
  }
  if (sources.empty()) throw std::runtime_error("no sessions in the files to merge");
  std::set<std::string> uuids;
  for (const Source& source : sources) {
    if (source.session.vocabulary_hash != sources.front().session.vocabulary_hash) {
      throw std::runtime_error(source.path + ": made with vocabulary " + source.session.vocabulary_hash + ", " +
                               sources.front().path + " with " + sources.front().session.vocabulary_hash +
                               "; flights can be merged only if they share one");
    }
    if (!uuids.insert(source.session.uuid).second) {
      throw std::runtime_error(source.path + ": session " + source.session.uuid + " is in another of the files too");
    }
  }
  // Of one file the order is kept, and with it the roots of its map.
  if (inputs.size() > 1) {
    std::stable_sort(sources.begin(), sources.end(),
                     [](const Source& a, const Source& b) { return a.session.start_utime < b.session.start_utime; });
  }
  const std::string temporary = out + ".part";
  RemoveDb(temporary);  // of one that was killed
  try {
    Database database(temporary, Database::Mode::kReadWrite);
    for (const Source& source : sources) CopySession(&database.Sql(), source);
    for (const std::string& path : inputs) CopyEdgeDecisions(&database.Sql(), path);
    database.Sql().exec("PRAGMA wal_checkpoint(TRUNCATE)");
  } catch (...) {
    RemoveDb(temporary);
    throw;
  }
  std::filesystem::rename(temporary, out);
  std::printf("%s: %zu sessions of %zu files\n", out.c_str(), sources.size(), inputs.size());
}

}  // namespace mapmend
