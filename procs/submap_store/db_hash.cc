#include <algorithm>
#include <map>
#include <mapmend/revision_part_t.hpp>
#include <mapmend/revision_t.hpp>

#include "libs/bus/bus.h"
#include "procs/submap_store/blob.h"
#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/revision_store.h"
#include "procs/submap_store/sha256.h"

namespace mapmend {
namespace {

std::string HashStream(Database* database) {
  std::vector<SessionRow> sessions = database->Sessions();
  std::sort(sessions.begin(), sessions.end(), [](const SessionRow& a, const SessionRow& b) { return a.uuid < b.uuid; });
  Sha256 hash;
  for (const SessionRow& session : sessions) {
    hash.Add(session.uuid);
    database->ReadRecords(session, 0, session.cumulative, [&](const EncodedRecord& record) {
      hash.Add(record.seq);
      hash.Add(record.channel);
      hash.Add(record.data);
      return true;
    });
  }
  return hash.Hex();
}

// How often the merger published says nothing about the map: its number and its cursors are left out.
std::string HashMap(Database* database) {
  RevisionStore revisions(database);
  revision_fetch_t request{};
  request.revision = -1;
  request.part = -1;
  const revision_fetched_t newest = revisions.Fetch(request);
  revision_t revision{};
  if (newest.status != revision_fetched_t::OK || !DecodeMessage(newest.data.data(), newest.num_bytes, &revision))
    return "";
  revision.transforms.revision = 0;
  revision.transforms.cursors.clear();
  revision.transforms.num_cursors = 0;
  Sha256 hash;
  hash.Add(EncodeMessage(revision));
  request.revision = newest.revision;
  for (request.part = 0; request.part < newest.num_parts; ++request.part) {
    const revision_fetched_t found = revisions.Fetch(request);
    revision_part_t part{};
    if (!DecodeMessage(found.data.data(), found.num_bytes, &part)) return "";
    part.revision = 0;
    hash.Add(EncodeMessage(part));
  }
  return hash.Hex();
}

}  // namespace

DbHash HashDb(const std::string& path) {
  Database database(path, Database::Mode::kReadOnly);
  return {HashStream(&database), HashMap(&database)};
}

}  // namespace mapmend
