#include "procs/submap_store/database.h"

#include <sqlite3.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "procs/submap_store/blob.h"
#include "procs/submap_store/row_checksum.h"
#include "procs/submap_store/schema.h"

namespace mapmend {
namespace {

constexpr int kBusyTimeoutMs = 5000;
constexpr int64_t kMaxTried = 2000000;  // records behind a damaged page; a higher last number is damage itself
constexpr int kFirstWithChecksums = 6;  // schema version

// The file as a URI that SQLite takes for unchanging.
std::string ImmutableUri(const std::string& path) {
  std::string uri = "file:";
  for (const char c : path) {
    if (c == '?' || c == '#' || c == '%') {
      static const char kDigits[] = "0123456789abcdef";
      uri += {'%', kDigits[c >> 4 & 15], kDigits[c & 15]};
    } else {
      uri += c;
    }
  }
  return uri + "?immutable=1";
}

// Marks an empty database as ours. It need not be a new file: of one whose creation was cut short, SQLite has just
// taken back all that was written.
void Identify(SQLite::Database* sql, const std::string& path) {
  if (sql->execAndGet("PRAGMA application_id").getInt() == kApplicationId) return;
  if (sql->execAndGet("SELECT count(*) FROM sqlite_master").getInt() != 0) {
    throw std::runtime_error(path + ": is not a map database (an SQLite file of another program)");
  }
  sql->exec("PRAGMA application_id = " + std::to_string(kApplicationId));
}

}  // namespace

Database::Database(const std::string& path, Mode mode) : path_(path) {
  if (mode == Mode::kScratch) {
    sql_ = std::make_unique<SQLite::Database>("", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    sql_->exec("PRAGMA journal_mode = OFF");
    Migrate(sql_.get());
    return;
  }
  guard_ = std::make_unique<FileGuard>(path, mode == Mode::kReadWrite  ? FileGuard::Access::kExclusive
                                             : mode == Mode::kReadOnly ? FileGuard::Access::kShared
                                                                       : FileGuard::Access::kSharedUnseen);
  const int flags = mode == Mode::kReadWrite ? SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE : SQLite::OPEN_READONLY;
  const bool is_at_rest = mode != Mode::kReadWrite && guard_->IsAtRest();
  sql_ = std::make_unique<SQLite::Database>(is_at_rest ? ImmutableUri(path) : path,
                                            is_at_rest ? flags | SQLite::OPEN_URI : flags, kBusyTimeoutMs);
  AddRowChecksum(sql_.get());
  if (mode == Mode::kDamaged) {
    sql_->exec("PRAGMA writable_schema = ON");  // else SQLite reads nothing of a truncated file
    has_checksums_ =
        sql_->execAndGet("SELECT count(*) FROM pragma_table_info('record') WHERE name = 'checksum'").getInt() != 0;
    return;
  }
  if (mode == Mode::kReadOnly) {
    const int version = sql_->execAndGet("PRAGMA user_version").getInt();
    if (version != kSchemaVersion) {
      throw std::runtime_error(
          path + ": has schema version " + std::to_string(version) + " instead of " + std::to_string(kSchemaVersion) +
          (version < kFirstWithChecksums ? ", without checksums" : "") + "; 'mapmend db compact' brings it up to date");
    }
    return;
  }
  Identify(sql_.get(), path);
  sql_->exec("PRAGMA journal_mode = WAL");
  sql_->exec("PRAGMA synchronous = FULL");
  // A second connection checkpoints (Checkpointer): done inside commits it makes some of them wait for half a second.
  sql_->exec("PRAGMA wal_autocheckpoint = 0");
  Migrate(sql_.get());
}

void Database::CheckPlace() {
  if (!guard_) return;
  const FileGuard::Place place = guard_->Look();
  if (place == FileGuard::Place::kSame) return;
  const bool is_free = place == FileGuard::Place::kNone;
  const std::string event =
      path_ + ": was " + (is_free ? "removed" : "replaced by another file") + " while it was in use";
  // The open file is all that is left of it.
  const std::string copy = path_ + ".rescued";
  std::remove(copy.c_str());
  try {
    SQLite::Statement vacuum(*sql_, "VACUUM INTO ?");
    vacuum.bind(1, copy);
    vacuum.exec();
  } catch (const SQLite::Exception& e) {
    throw FileGone(event + "; what was in it cannot be written anew (" + e.what() + ")", false);
  }
  if (!is_free) throw FileGone(event + "; what was in it is in " + copy, false);
  // A log of the old file must not be taken for the new one's.
  for (const char* suffix : {"-wal", "-shm"}) std::remove((path_ + suffix).c_str());
  if (std::rename(copy.c_str(), path_.c_str()) != 0)
    throw FileGone(event + "; what was in it is in " + copy + " (" + std::strerror(errno) + ")", false);
  throw FileGone(event + "; what was in it has been written anew", true);
}

void Database::SetCommitHook(std::function<void()> hook) {
  commit_hook_ = std::move(hook);
  const auto call = [](void* self, sqlite3*, const char*, int) {
    static_cast<Database*>(self)->commit_hook_();
    return SQLITE_OK;
  };
  sqlite3_wal_hook(sql_->getHandle(), call, this);
}

Database::Use Database::Prepare(const std::string& sql) {
  auto& statement = statements_[sql];
  if (!statement) statement = std::make_unique<SQLite::Statement>(*sql_, sql);
  return Use(statement.get());
}

std::vector<SessionRow> Database::Sessions() {
  std::vector<SessionRow> sessions;
  Use query = Prepare(
      "SELECT id, uuid, vehicle, source, vocabulary_hash, start_utime, ended, is_derived, "
      "max(ifnull((SELECT max(seq) FROM record WHERE session = id), -1), "
      "ifnull((SELECT max(last_seq) FROM gap WHERE session = id), -1)), settings FROM session ORDER BY id");
  while (query->executeStep()) {
    SessionRow row;
    row.id = query->getColumn(0).getInt64();
    row.uuid = query->getColumn(1).getString();
    row.vehicle = query->getColumn(2).getString();
    row.source = query->getColumn(3).getString();
    row.vocabulary_hash = query->getColumn(4).getString();
    row.start_utime = query->getColumn(5).getInt64();
    row.ended = query->getColumn(6).getInt() != 0;
    row.is_derived = query->getColumn(7).getInt() != 0;
    row.cumulative = query->getColumn(8).getInt64();
    row.settings = query->getColumn(9).getString();
    sessions.push_back(std::move(row));
  }
  return sessions;
}

std::vector<GapRow> Database::Gaps(int64_t session) {
  std::vector<GapRow> gaps;
  Use query = Prepare(std::string("SELECT first_seq, last_seq, reason FROM gap WHERE session = ?") +
                      (has_checksums_ ? " AND checksum IS row_checksum(first_seq, last_seq, reason)" : "") +
                      " ORDER BY first_seq");
  query->bind(1, session);
  while (query->executeStep()) {
    gaps.push_back(
        {session, query->getColumn(0).getInt64(), query->getColumn(1).getInt64(), query->getColumn(2).getString()});
  }
  return gaps;
}

void Database::ReadRecords(const SessionRow& session, int64_t first, int64_t last,
                           const std::function<bool(EncodedRecord)>& visit, const OnDamaged& on_damaged) {
  const std::string select = std::string("SELECT seq, channel, payload, utime, ") +
                             (has_checksums_ ? "checksum IS row_checksum(channel, payload)" : "1") +
                             " FROM record WHERE session = ? AND ";
  int64_t seq = first;  // that is read now
  // The next row of a query. False if there is none, or SQLite cannot read it: then *is_readable is false.
  const auto read = [&](SQLite::Statement* query, EncodedRecord* record, std::string* what, bool* is_readable) {
    try {
      if (!query->executeStep()) return false;
      record->session = session.uuid;
      record->seq = seq = query->getColumn(0).getInt64();
      record->channel = query->getColumn(1).getString();
      record->data = ReadBlob<uint8_t>(query->getColumn(2));
      const auto header = PeekHeader(record->data.data(), static_cast<int>(record->data.size()));
      *what = "";
      if (query->getColumn(4).getInt() == 0) {
        *what = "its checksum does not fit";
      } else if (!header || header->session != session.uuid || header->seq != seq ||
                 header->utime != query->getColumn(3).getInt64()) {
        *what = "its payload names another record";
      }
      return true;
    } catch (const SQLite::Exception& e) {
      if (!IsDamage(e)) throw;
      *what = e.what();
      *is_readable = false;
      return false;
    }
  };
  EncodedRecord record;
  std::string what;
  const auto take = [&] {
    if (what.empty()) return visit(std::move(record));
    if (on_damaged) on_damaged(seq, record.channel, what);
    return true;
  };
  bool is_readable = true;
  {
    Use query = Prepare(select + "seq >= ? AND seq <= ? ORDER BY seq");
    query->bind(1, session.id);
    query->bind(2, first);
    query->bind(3, last);
    while (read(query.get(), &record, &what, &is_readable)) {
      if (!take()) return;
      ++seq;
    }
  }
  // Behind a damaged page the others are still to be had, one by one.
  if (!is_readable) last = std::min(last, seq + kMaxTried);
  for (; !is_readable && seq <= last; ++seq) {
    Use query = Prepare(select + "seq = ?");
    query->bind(1, session.id);
    query->bind(2, seq);
    bool is_row_readable = true;
    record.channel.clear();
    const bool found = read(query.get(), &record, &what, &is_row_readable);
    if ((found || !is_row_readable) && !take()) return;
  }
}

std::optional<std::vector<uint8_t>> Database::ReadPayload(int64_t session, int64_t seq) {
  Use query = Prepare("SELECT payload FROM record WHERE session = ? AND seq = ?");
  query->bind(1, session);
  query->bind(2, seq);
  if (!query->executeStep()) return std::nullopt;
  return ReadBlob<uint8_t>(query->getColumn(0));
}

bool IsDamage(const SQLite::Exception& e) {
  const int code = e.getErrorCode() & 0xff;
  return code == SQLITE_CORRUPT || code == SQLITE_NOTADB || code == SQLITE_TOOBIG || code == SQLITE_NOMEM;
}

}  // namespace mapmend
