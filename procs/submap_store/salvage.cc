#include "procs/submap_store/salvage.h"

#include <algorithm>
#include <functional>
#include <stdexcept>

#include "procs/submap_store/blob.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/derived_tables.h"
#include "procs/submap_store/edge_decisions.h"
#include "procs/submap_store/repair_source.h"
#include "procs/submap_store/session_log.h"

namespace mapmend {
namespace {

constexpr int64_t kMaxSeq = 10000000;  // a higher number is damage

// What cannot be read is left for the next step.
bool Try(const std::function<void()>& read) {
  try {
    read();
    return true;
  } catch (const SQLite::Exception& e) {
    // Of a damaged schema, a table or a column may be missing.
    if (!IsDamage(e) && e.getErrorCode() != 1) throw;
    return false;
  }
}

// Those that are sound. False if some are not.
bool ReadDecisions(Database* database, std::vector<EdgeDecision>* decisions) {
  bool is_whole = true;
  const bool is_readable = Try([&] {
    auto rows =
        database->Prepare(std::string("SELECT session_a, submap_a, session_b, submap_b, disabled, ") +
                          (database->HasChecksums()
                               ? "checksum IS row_checksum(number, session_a, submap_a, session_b, submap_b, disabled)"
                               : "1") +
                          " FROM edge_decision ORDER BY number");
    while (rows->executeStep()) {
      if (rows->getColumn(5).getInt() == 0) {
        is_whole = false;
        continue;
      }
      decisions->push_back({{rows->getColumn(0).getString(), SubmapId(rows->getColumn(1).getInt())},
                            {rows->getColumn(2).getString(), SubmapId(rows->getColumn(3).getInt())},
                            rows->getColumn(4).getInt() != 0});
    }
  });
  return is_readable && is_whole;
}

}  // namespace

Salvage::Salvage(Database* from, Database* into) : from_(from), into_(into) {
  std::vector<SessionRow> rows;
  Try([&] { rows = from_->Sessions(); });
  for (SessionRow& row : rows) {
    if (!IsSessionId(row.uuid)) continue;
    Known& known = sessions_[row.uuid];
    known.id = row.id;
    Try([&] { known.gaps = from_->Gaps(row.id); });
    for (const GapRow& gap : known.gaps) {
      known.last = std::max(known.last, gap.last_seq);
      if (gap.reason == kClosedReason) known.closed_at = std::min(known.closed_at, gap.first_seq);
    }
    known.last = std::max(known.last, std::min(row.cumulative, kMaxSeq));
    known.row = std::move(row);
  }
  is_open_ = sessions_.empty();
}

bool Salvage::Insert(const EncodedRecord& record) {
  const auto header = PeekHeader(record.data.data(), static_cast<int>(record.data.size()));
  const auto found = sessions_.find(record.session);
  if (!header || (found == sessions_.end() && !is_open_)) return false;
  Known& known = sessions_[record.session];
  if (known.id == 0) {
    for (const auto& [uuid, other] : sessions_) known.id = std::max(known.id, other.id + 1);
  }
  Database::Use insert = into_->Prepare(
      "INSERT OR IGNORE INTO record(session, seq, channel, utime, payload, checksum) VALUES(?1, ?2, ?3, ?4, ?5, "
      "row_checksum(?3, ?5))");
  insert->bind(1, known.id);
  insert->bind(2, record.seq);
  insert->bind(3, record.channel);
  insert->bind(4, header->utime);
  BindBlob(insert.get(), 5, record.data);
  if (insert->exec() == 0) return false;
  known.last = std::max(known.last, record.seq);
  return true;
}

void Salvage::TakeDatabase() {
  SQLite::Transaction transaction(into_->Sql());
  bool is_whole = !sessions_.empty();
  for (const auto& [uuid, known] : std::map<std::string, Known>(sessions_)) {
    is_whole &= Try([&, &session = known] {
      from_->ReadRecords(
          session.row, 0, session.last,
          [&](const EncodedRecord& record) {
            Insert(record);
            return true;
          },
          [&](int64_t, const std::string&, const std::string&) { is_whole = false; });
    });
  }
  if (!is_whole) TakeRows();
  transaction.commit();
}

// What the session table calls otherwise is a damaged name.
void Salvage::GiveName(int64_t id, const std::string& uuid) {
  for (auto it = sessions_.begin(); it != sessions_.end(); ++it) {
    if (it->second.id != id) continue;
    auto node = sessions_.extract(it);
    node.key() = uuid;
    sessions_.insert(std::move(node));
    return;
  }
}

void Salvage::TakeRows() {
  const bool was_open = std::exchange(is_open_, true);  // sessions that the session table does not show
  int64_t last = 0;
  if (!Try([&] { last = from_->Sql().execAndGet("SELECT max(rowid) FROM record").getInt64(); }))
    Try([&] { last = from_->Sql().execAndGet("PRAGMA page_count").getInt64(); });
  for (int64_t row = 1; row <= last; ++row) {
    Try([&] {
      auto query = from_->Prepare(std::string("SELECT channel, payload, ") +
                                  (from_->HasChecksums() ? "checksum IS row_checksum(channel, payload)" : "1") +
                                  ", session FROM record "
                                  "WHERE rowid = ?");
      query->bind(1, row);
      if (!query->executeStep() || query->getColumn(2).getInt() == 0) return;
      EncodedRecord record;
      record.channel = query->getColumn(0).getString();
      record.data = ReadBlob<uint8_t>(query->getColumn(1));
      const auto header = PeekHeader(record.data.data(), static_cast<int>(record.data.size()));
      if (!header || !IsRecordChannel(record.channel)) return;
      record.session = header->session;
      record.seq = header->seq;
      if (!sessions_.contains(record.session)) GiveName(query->getColumn(3).getInt64(), record.session);
      Insert(record);
    });
  }
  is_open_ = was_open && sessions_.empty();
}

int64_t Salvage::TakeSource(const std::string& path) {
  sources_.push_back(path);
  SQLite::Transaction transaction(into_->Sql());
  int64_t num_taken = 0;
  ReadRepairSource(path, [&](const EncodedRecord& record) {
    // Behind the place where the store closed a session, its numbers are the store's own.
    const auto found = sessions_.find(record.session);
    if (found != sessions_.end() && record.seq >= found->second.closed_at) return;
    if (!Insert(record)) return;
    ++num_taken;
    for (const GapRow& gap : sessions_.at(record.session).gaps)
      filled_gap_ = filled_gap_ || (gap.first_seq <= record.seq && record.seq <= gap.last_seq);
  });
  transaction.commit();
  return num_taken;
}

void Salvage::WriteGap(const GapRow& gap) {
  auto insert = into_->Prepare(
      "INSERT OR IGNORE INTO gap(session, first_seq, last_seq, reason, checksum) VALUES(?1, ?2, ?3, ?4, "
      "row_checksum(?2, ?3, ?4))");
  insert->bind(1, gap.session);
  insert->bind(2, gap.first_seq);
  insert->bind(3, gap.last_seq);
  insert->bind(4, gap.reason);
  insert->exec();
}

void Salvage::WriteSession(Known* known, const std::string& uuid, std::vector<std::string>* lost) {
  std::vector<int64_t> seqs;
  {
    auto rows = into_->Prepare("SELECT seq FROM record WHERE session = ? ORDER BY seq");
    rows->bind(1, known->id);
    while (rows->executeStep()) seqs.push_back(rows->getColumn(0).getInt64());
  }
  const auto first = into_->ReadPayload(known->id, 0);
  DecodedRecord start;
  if (first) start = DecodeRecord("MAPMEND_SESSION", first->data(), static_cast<int>(first->size()));
  if (!start.record) {
    lost->push_back("session " + uuid + ": its first record is lost, so nothing of it can be mapped");
    auto remove = into_->Prepare("DELETE FROM record WHERE session = ?");
    remove->bind(1, known->id);
    remove->exec();
    return;
  }
  const int64_t id = InsertSession(into_, start.record->header, std::get<SessionStarted>(start.record->body));
  auto number = into_->Prepare("UPDATE session SET id = ?, is_derived = 0 WHERE id = ?");
  number->bind(1, known->id);
  number->bind(2, id);
  number->exec();
  // One without records says where the store closed the session.
  for (const GapRow& gap : known->gaps) {
    if (gap.last_seq < gap.first_seq) WriteGap({known->id, gap.first_seq, gap.last_seq, gap.reason});
  }
  seqs.push_back(known->last + 1);
  int64_t expected = 0;
  for (const int64_t seq : seqs) {
    while (expected < seq) {
      // Up to the end of the gap that it is in, or up to the next one.
      GapRow gap{known->id, expected, seq - 1, "damaged"};
      for (const GapRow& old : known->gaps) {
        if (old.first_seq <= expected && expected <= old.last_seq) {
          gap.last_seq = std::min(gap.last_seq, old.last_seq);
          gap.reason = old.reason;
        } else if (old.first_seq > expected) {
          gap.last_seq = std::min(gap.last_seq, old.first_seq - 1);
        }
      }
      WriteGap(gap);
      const std::string range = gap.last_seq == expected ? "record " + std::to_string(expected) + " is"
                                                         : "records " + std::to_string(expected) + " to " +
                                                               std::to_string(gap.last_seq) + " are";
      lost->push_back("session " + uuid + ": " + range + " not to be had (" + gap.reason + ")");
      expected = gap.last_seq + 1;
    }
    expected = seq + 1;
  }
}

void Salvage::TakeDecisions(std::vector<std::string>* lost) {
  std::vector<EdgeDecision> taken;
  bool is_whole = ReadDecisions(from_, &taken);
  for (auto source = sources_.begin(); !is_whole && source != sources_.end(); ++source) {
    if (!IsDatabase(*source)) continue;
    Database other(*source, Database::Mode::kDamaged);
    std::vector<EdgeDecision> decisions;
    is_whole = ReadDecisions(&other, &decisions);
    if (is_whole) taken = std::move(decisions);
  }
  EdgeDecisions decisions(into_);
  for (const EdgeDecision& decision : taken) decisions.Decide(EdgeRequest{Addressed(), {decision}});
  if (!is_whole) lost->push_back("decisions on connections are damaged: see `mapmend edges list`, and make them again");
}

void Salvage::Finish(std::vector<std::string>* lost) {
  if (sessions_.empty()) throw std::runtime_error(from_->Path() + ": nothing in it can be read, not even its sessions");
  SQLite::Transaction transaction(into_->Sql());
  std::vector<std::pair<int64_t, std::string>> order;
  for (const auto& [uuid, known] : sessions_) order.emplace_back(known.id, uuid);
  std::sort(order.begin(), order.end());
  for (const auto& [id, uuid] : order) WriteSession(&sessions_.at(uuid), uuid, lost);
  transaction.commit();
  TakeDecisions(lost);
}

}  // namespace mapmend
