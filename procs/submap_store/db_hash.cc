#include <algorithm>
#include <stdexcept>
#include <utility>

#include "libs/wire/revision_codec.h"
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

template <typename Message>
Message ReadSound(const RevisionAnswer& stored, const std::string& path) {
  Decoded<Message> decoded = Decode<Message>(stored.data);
  if (stored.status != RevisionAnswer::Status::kOk || !decoded.value)
    throw std::runtime_error(path + ": the merged map is damaged" + kSeeCheck);
  return std::move(*decoded.value);
}

// How often the merger published says nothing about the map: its number and its cursors are left out.
std::string HashMap(Database* database) {
  RevisionStore revisions(database);
  RevisionRequest request;
  const RevisionAnswer newest = revisions.Fetch(request);
  if (newest.revision < 0) return "";
  RevisionHead head = ReadSound<RevisionHead>(newest, database->Path());
  head.transforms.revision = 0;
  head.transforms.cursors.clear();
  Sha256 hash;
  hash.Add(Encode(head));
  request.revision = newest.revision;
  for (request.part = 0; request.part < newest.num_parts; ++request.part) {
    RevisionPart part = ReadSound<RevisionPart>(revisions.Fetch(request), database->Path());
    part.revision = 0;
    hash.Add(Encode(part));
  }
  return hash.Hex();
}

}  // namespace

DbHash HashDb(const std::string& path) {
  Database database(path, Database::Mode::kReadOnly);
  return {HashStream(&database), HashMap(&database)};
}

}  // namespace mapmend
