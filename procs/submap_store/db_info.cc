#include <cstdio>

#include "libs/base/plural.h"
#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/edge_decisions.h"
#include "procs/submap_store/revision_store.h"
#include "procs/submap_store/schema.h"

namespace mapmend {
namespace {

void PrintSizes(Database* database) {
  // dbstat knows what each table and index takes, unused parts of pages included.
  auto rows = database->Prepare("SELECT name, sum(pgsize) FROM dbstat GROUP BY name ORDER BY 2 DESC");
  std::printf("bytes in the file:\n");
  while (rows->executeStep()) {
    const int64_t bytes = rows->getColumn(1).getInt64();
    if (bytes > 4096) std::printf("  %-36s %14lld\n", rows->getColumn(0).getText(), static_cast<long long>(bytes));
  }
  auto channels =
      database->Prepare("SELECT channel, count(*), sum(length(payload)) FROM record GROUP BY channel ORDER BY 3 DESC");
  std::printf("payload of the records:\n");
  while (channels->executeStep()) {
    std::printf("  %-20s %8lld records %14lld bytes\n", channels->getColumn(0).getText(),
                static_cast<long long>(channels->getColumn(1).getInt64()),
                static_cast<long long>(channels->getColumn(2).getInt64()));
  }
}

void PrintSession(Database* database, const SessionRow& session) {
  std::printf("session %s  vehicle '%s'  source '%s'  records %lld  %s\n", session.uuid.c_str(),
              session.vehicle.c_str(), session.source.c_str(), static_cast<long long>(session.cumulative + 1),
              session.ended ? "ended" : "open");
  auto rows = database->Prepare(
      "SELECT submap, (SELECT count(*) FROM keyframe k WHERE k.session = s.session AND k.submap = s.submap AND "
      "removed_seq IS NULL), "
      "ifnull(num_points, -1), ifnull(num_frames, -1), ifnull(end_reason, 'open'), ifnull(end_detail, '') "
      "FROM submap s WHERE session = ? ORDER BY submap");
  rows->bind(1, session.id);
  while (rows->executeStep()) {
    std::printf("  submap %-4d %6d keyframes", rows->getColumn(0).getInt(), rows->getColumn(1).getInt());
    if (rows->getColumn(2).getInt() >= 0) {
      std::printf(" %8d points %6d frames", rows->getColumn(2).getInt(), rows->getColumn(3).getInt());
    }
    std::printf("  %s  %s\n", rows->getColumn(4).getText(), rows->getColumn(5).getText());
  }
  for (const GapRow& gap : database->Gaps(session.id)) {
    if (gap.last_seq < gap.first_seq) {
      std::printf("  from record %lld on by the store: %s\n", static_cast<long long>(gap.first_seq),
                  gap.reason.c_str());
      continue;
    }
    std::printf("  gap: records %lld to %lld, %s\n", static_cast<long long>(gap.first_seq),
                static_cast<long long>(gap.last_seq), gap.reason.c_str());
  }
}

}  // namespace

void PrintDbInfo(const std::string& path) {
  Database database(path, Database::Mode::kReadOnly);
  std::printf("%s: map database, schema %d\n", path.c_str(), kSchemaVersion);
  const std::vector<SessionRow> sessions = database.Sessions();
  if (!sessions.empty()) std::printf("vocabulary %s\n", sessions.front().vocabulary_hash.c_str());
  for (const SessionRow& session : sessions) PrintSession(&database, session);
  const int64_t newest = RevisionStore(&database).NewestComplete();
  if (newest >= 0) {
    auto counts = database.Prepare(
        "SELECT count(*), count(DISTINCT component), (SELECT count(*) FROM connection WHERE revision = ?1 AND verdict "
        "= 0) "
        "FROM merged_submap WHERE revision = ?1");
    counts->bind(1, newest);
    if (counts->executeStep()) {
      std::printf("merged map: revision %lld, %s in %s, %s\n", static_cast<long long>(newest),
                  Plural(counts->getColumn(0).getInt(), "submap").c_str(),
                  Plural(counts->getColumn(1).getInt(), "component").c_str(),
                  Plural(counts->getColumn(2).getInt(), "accepted connection").c_str());
    }
  }
  for (const EdgeDecision& d : EdgeDecisions(&database).All()) {
    std::printf("decision: connection of submap %d of %s and submap %d of %s %s\n", d.a.submap.value,
                d.a.session.c_str(), d.b.submap.value, d.b.session.c_str(),
                d.disabled ? "switched off" : "left to the merger again");
  }
  PrintSizes(&database);
}

}  // namespace mapmend
