#include "procs/submap_store/revision_store.h"

#include <array>

#include "libs/wire/revision_codec.h"
#include "procs/submap_store/blob.h"

namespace mapmend {
namespace {

void Delete(Database* database, int64_t revision) {
  for (const char* table : {"revision", "revision_part", "merged_submap", "connection"}) {
    auto remove = database->Prepare(std::string("DELETE FROM ") + table + " WHERE revision = ?");
    remove->bind(1, revision);
    remove->exec();
  }
}

void InsertSubmaps(Database* database, const MergedTransforms& transforms) {
  for (const MergedTransforms::Place& place : transforms.submaps) {
    auto insert =
        database->Prepare("INSERT OR REPLACE INTO merged_submap VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
    insert->bind(1, transforms.revision);
    insert->bind(2, place.key.session);
    insert->bind(3, place.key.submap.value);
    insert->bind(4, place.component);
    insert->bind(5, place.is_root ? 1 : 0);
    const std::array<double, 8> root_from_submap = ToArray(place.root_from_submap);
    for (int i = 0; i < 8; ++i) insert->bind(6 + i, root_from_submap[static_cast<size_t>(i)]);
    insert->exec();
  }
}

void InsertConnections(Database* database, int64_t revision, const std::vector<EvaluatedConnection>& connections) {
  for (const EvaluatedConnection& connection : connections) {
    auto insert = database->Prepare("INSERT INTO connection VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
    insert->bind(1, revision);
    insert->bind(2, connection.a.session);
    insert->bind(3, connection.a.submap.value);
    insert->bind(4, connection.b.session);
    insert->bind(5, connection.b.submap.value);
    insert->bind(6, static_cast<int>(connection.verdict));
    insert->bind(7, connection.reason);
    insert->bind(8, connection.num_connected_frames);
    insert->bind(9, connection.num_common_points);
    insert->bind(10, connection.median_angle_deg);
    insert->bind(11, connection.strength);
    insert->bind(12, connection.num_inliers);
    insert->bind(13, connection.b_from_a.scale);
    insert->bind(14, connection.in_tree ? 1 : 0);
    insert->exec();
  }
}

}  // namespace

std::optional<RevisionAck> RevisionStore::Store(const uint8_t* data, int size) {
  const Decoded<RevisionHead> decoded = Decode<RevisionHead>(data, size);
  if (!decoded.value) return std::nullopt;
  const RevisionHead& revision = *decoded.value;
  const int64_t number = revision.transforms.revision;
  {
    auto same = database_->Prepare("SELECT 1 FROM revision WHERE revision = ? AND payload = ?");
    same->bind(1, number);
    same->bindNoCopy(2, data, size);
    if (same->executeStep()) return RevisionAck{number, -1};
  }
  SQLite::Transaction transaction(database_->Sql());
  Delete(database_, number);
  auto insert = database_->Prepare(
      "INSERT INTO revision(revision, refined, final, num_parts, payload, checksum) "
      "VALUES(?1, ?2, ?3, ?4, ?5, row_checksum(?1, ?2, ?3, ?4, ?5))");
  insert->bind(1, number);
  insert->bind(2, revision.transforms.refined ? 1 : 0);
  insert->bind(3, revision.transforms.is_final ? 1 : 0);
  insert->bind(4, revision.num_parts);
  insert->bindNoCopy(5, data, size);
  insert->exec();
  InsertSubmaps(database_, revision.transforms);
  InsertConnections(database_, number, revision.connections);
  transaction.commit();
  return RevisionAck{number, -1};
}

std::optional<RevisionAck> RevisionStore::StorePart(const uint8_t* data, int size) {
  const Decoded<RevisionPart> decoded = Decode<RevisionPart>(data, size);
  if (!decoded.value) return std::nullopt;
  const RevisionPart& part = *decoded.value;
  {
    auto same = database_->Prepare("SELECT 1 FROM revision_part WHERE revision = ? AND part = ? AND payload = ?");
    same->bind(1, part.revision);
    same->bind(2, part.part);
    same->bindNoCopy(3, data, size);
    if (same->executeStep()) return RevisionAck{part.revision, part.part};  // it came again
  }
  SQLite::Transaction transaction(database_->Sql());
  {
    auto insert = database_->Prepare(
        "INSERT OR REPLACE INTO revision_part(revision, part, session, submap, payload, checksum) "
        "VALUES(?1, ?2, ?3, ?4, ?5, row_checksum(?1, ?2, ?3, ?4, ?5))");
    insert->bind(1, part.revision);
    insert->bind(2, part.part);
    insert->bind(3, part.submap.key.session);
    insert->bind(4, part.submap.key.submap.value);
    insert->bindNoCopy(5, data, size);
    insert->exec();
  }
  const int64_t newest = NewestComplete();
  if (newest == part.revision) {
    auto prune = database_->Prepare("DELETE FROM revision_part WHERE revision < ?");
    prune->bind(1, newest);
    prune->exec();
  }
  transaction.commit();
  return RevisionAck{part.revision, part.part};
}

int64_t RevisionStore::NewestComplete() {
  auto query = database_->Prepare(
      "SELECT revision FROM revision r WHERE num_parts = (SELECT count(*) FROM revision_part p WHERE p.revision = "
      "r.revision "
      "AND p.part < r.num_parts) ORDER BY revision DESC LIMIT 1");
  return query->executeStep() ? query->getColumn(0).getInt64() : -1;
}

RevisionAnswer RevisionStore::Fetch(const RevisionRequest& request) {
  RevisionAnswer reply;
  reply.id = request.id;
  reply.requester = request.requester;
  reply.status = RevisionAnswer::Status::kNone;
  reply.revision = request.revision < 0 ? NewestComplete() : request.revision;
  reply.part = request.part;
  auto revision = database_->Prepare(
      "SELECT num_parts, payload, checksum IS row_checksum(revision, refined, final, num_parts, payload) FROM revision "
      "WHERE revision = ?");
  revision->bind(1, reply.revision);
  if (!revision->executeStep()) return reply;
  reply.num_parts = revision->getColumn(0).getInt();
  if (request.part < 0) {
    if (revision->getColumn(2).getInt() == 0) return reply;  // damaged: as good as none
    reply.data = ReadBlob<uint8_t>(revision->getColumn(1));
    reply.status = RevisionAnswer::Status::kOk;
  } else {
    auto part = database_->Prepare(
        "SELECT payload FROM revision_part WHERE revision = ? AND part = ? AND checksum IS row_checksum(revision, "
        "part, session, submap, payload)");
    part->bind(1, reply.revision);
    part->bind(2, request.part);
    if (part->executeStep()) {
      reply.data = ReadBlob<uint8_t>(part->getColumn(0));
      reply.status = RevisionAnswer::Status::kOk;
    }
  }
  return reply;
}

}  // namespace mapmend
