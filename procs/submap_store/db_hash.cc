#include <algorithm>
#include <map>
#include <mapmend/revision_part_t.hpp>
#include <mapmend/revision_t.hpp>
#include <stdexcept>

#include "libs/bus/bus.h"
#include "procs/submap_store/blob.h"
#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/revision_store.h"
#include "procs/submap_store/sha256.h"

namespace mapmend {
namespace {

// Digests of what is damaged would be taken for those of another flight.
constexpr char kSeeCheck[] = "; `mapmend db check` says what is damaged, `mapmend db repair` mends it";

std::string HashStream(Database* database) {
  std::vector<SessionRow> sessions = database->Sessions();
  std::sort(sessions.begin(), sessions.end(), [](const SessionRow& a, const SessionRow& b) { return a.uuid < b.uuid; });
  Sha256 hash;
  for (const SessionRow& session : sessions) {
    hash.Add(session.uuid);
    database->ReadRecords(
        session, 0, session.cumulative,
        [&](const EncodedRecord& record) {
          hash.Add(record.seq);
          hash.Add(record.channel);
          hash.Add(record.data);
          return true;
        },
        [&](int64_t seq, const std::string& channel, const std::string& what) {
          throw std::runtime_error(database->Path() + ": session " + session.uuid + ", record " + std::to_string(seq) +
                                   DescribeChannel(channel) + ": " + what + kSeeCheck);
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
  if (newest.revision < 0) return "";
  if (newest.status != revision_fetched_t::OK || !DecodeMessage(newest.data.data(), newest.num_bytes, &revision)) {
    throw std::runtime_error(database->Path() + ": the merged map is damaged" + kSeeCheck);
  }
  revision.transforms.revision = 0;
  revision.transforms.cursors.clear();
  revision.transforms.num_cursors = 0;
  Sha256 hash;
  hash.Add(EncodeMessage(revision));
  request.revision = newest.revision;
  for (request.part = 0; request.part < newest.num_parts; ++request.part) {
    const revision_fetched_t found = revisions.Fetch(request);
    revision_part_t part{};
    if (found.status != revision_fetched_t::OK || !DecodeMessage(found.data.data(), found.num_bytes, &part)) {
      throw std::runtime_error(database->Path() + ": the merged map is damaged" + kSeeCheck);
    }
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
