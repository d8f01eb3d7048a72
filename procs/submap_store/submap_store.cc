#include "procs/submap_store/submap_store.h"

#include <spdlog/spdlog.h>
#include <sqlite3.h>

#include <algorithm>
#include <stdexcept>

#include "libs/base/options.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/session_progress.h"
#include "procs/submap_store/submap_model.h"

namespace mapmend {
namespace {

constexpr int64_t kAckWithinMs = 2000;
constexpr int32_t kMaxFetchBytes = 8 << 20;
constexpr size_t kMaxOpenSessions = 256;  // that have sent nothing valid yet

std::string Describe(const SQLite::Exception& e, const std::string& path) {
  switch (e.getErrorCode()) {
    case SQLITE_FULL:
      return "disk full: " + path + ": nothing more is stored until there is room";
    case SQLITE_IOERR:
      return path + ": the disk reports an error (" + std::string(e.what()) +
             "): nothing more is stored until it is gone";
    default:
      return path + ": database: " + e.what();
  }
}

Session MakeStub(const SessionRow& row) {
  Session model;
  model.id = row.uuid;
  model.start_utime = row.start_utime;
  model.last_seq = row.cumulative;
  model.ended = row.ended;
  model.info.settings_json = row.settings;
  return model;
}

// What is committed of a session, but for the frames of submaps that are open.
SeenFrames FramesInFile(Database* database, int64_t session) {
  SeenFrames seen;
  auto query = database->Prepare(
      "SELECT min(frame), max(frame), max(utime), (SELECT max(last_frame) FROM submap WHERE session = ?1), (SELECT "
      "max(end_utime) FROM submap WHERE session = ?1) FROM keyframe WHERE session = ?1");
  query->bind(1, session);
  if (!query->executeStep() || query->getColumn(0).isNull()) return seen;
  seen.Note(query->getColumn(0).getInt(), 0);
  seen.Note(query->getColumn(1).getInt(), query->getColumn(2).getInt64());
  if (!query->getColumn(3).isNull()) seen.Note(query->getColumn(3).getInt(), query->getColumn(4).getInt64());
  return seen;
}

}  // namespace

std::string SubmapStoreOptions::Check() const {
  return path.empty() ? "no database file is given" : CheckOptions(*this);
}

SubmapStore::SubmapStore(const SubmapStoreOptions& options)
    : options_(options),
      database_((options.Check().empty() ? options.path : throw std::runtime_error(options.Check())),
                Database::Mode::kReadWrite),
      search_(options.retrieval, &database_),
      revisions_(&database_),
      edge_decisions_(&database_),
      checkpointer_(options.path, options.checkpoint_interval_ms),
      vocabulary_hash_(options.vocabulary_hash) {
  database_.SetCommitHook([this] { checkpointer_.OnCommit(); });
  for (const SessionRow& row : database_.Sessions()) {
    if (vocabulary_hash_.empty()) vocabulary_hash_ = row.vocabulary_hash;
    if (row.vocabulary_hash != vocabulary_hash_) {
      throw std::runtime_error(options.path + ": session " + row.uuid + " was made with vocabulary " +
                               row.vocabulary_hash + ", not with " + vocabulary_hash_ +
                               "; use its vocabulary or another file");
    }
    if (!row.is_derived) RebuildDerivedRows(&database_, row);
  }
  search_.Load();
  for (const SessionRow& row : database_.Sessions()) Restore(row);
  auto count = database_.Prepare("SELECT count(*) FROM record");
  if (count->executeStep()) num_records_ = count->getColumn(0).getInt64();
}

void SubmapStore::Restore(const SessionRow& row) {
  auto state = std::make_unique<SessionState>(row.uuid, options_.log);
  state->row = row.id;
  Session model = MakeStub(row);
  struct SubmapRow {
    SubmapId submap;
    int64_t start_seq, end_seq;
    bool has_geometry;
  };
  std::vector<SubmapRow> submaps;
  {
    auto rows =
        database_.Prepare("SELECT submap, start_seq, ifnull(end_seq, -1), has_geometry FROM submap WHERE session = ?");
    rows->bind(1, row.id);
    while (rows->executeStep()) {
      submaps.push_back({SubmapId(rows->getColumn(0).getInt()), rows->getColumn(1).getInt64(),
                         rows->getColumn(2).getInt64(), rows->getColumn(3).getInt() != 0});
    }
  }
  for (const SubmapRow& submap : submaps) {
    const bool is_open = submap.end_seq < 0;
    Submap& known = model.submaps[submap.submap];
    known.id = submap.submap;
    known.ended = !is_open;
    if (!is_open && submap.has_geometry) continue;
    SubmapTracker tracker(&database_, row, submap.submap, submap.start_seq);
    Submap content = tracker.AsOf(is_open ? row.cumulative : submap.end_seq);
    if (is_open) {
      known = std::move(content);
    } else {
      geometry_.emplace_back(row.id, std::move(content));
    }
  }
  int32_t last_keyframe = -1;
  {
    auto query = database_.Prepare("SELECT ifnull(max(keyframe), -1) FROM keyframe WHERE session = ?");
    query->bind(1, row.id);
    if (query->executeStep()) last_keyframe = query->getColumn(0).getInt();
  }
  std::vector<LogGap> gaps;
  for (const GapRow& gap : database_.Gaps(row.id)) {
    gaps.push_back({gap.first_seq, gap.last_seq, gap.reason});
    num_gaps_ += gap.last_seq - gap.first_seq + 1;
  }
  SeenFrames seen = FramesInFile(&database_, row.id);
  for (const auto& [id, submap] : model.submaps) {
    for (const TrackedFrame& frame : submap.frames) seen.Note(frame.frame, frame.utime);
  }
  state->log.Restore(std::move(model), row.cumulative, last_keyframe, gaps, seen);
  sessions_[row.uuid] = std::move(state);
}

SubmapStore::SessionState* SubmapStore::Find(const std::string& session) {
  const auto it = sessions_.find(session);
  return it == sessions_.end() ? nullptr : it->second.get();
}

SubmapStore::SessionState* SubmapStore::FindOrAdd(const std::string& session) {
  if (SessionState* state = Find(session)) return state;
  const auto is_new = [](const auto& item) { return item.second->row == 0; };
  if (static_cast<size_t>(std::count_if(sessions_.begin(), sessions_.end(), is_new)) >= kMaxOpenSessions)
    return nullptr;
  auto& state = sessions_[session];
  state = std::make_unique<SessionState>(session, options_.log);
  return state.get();
}

// The same record again is what the protocol expects; another one under its number is not.
bool SubmapStore::IsConflict(const SessionState& state, const EncodedRecord& record) {
  if (state.row == 0 || record.seq > state.log.Cumulative()) return false;
  const auto stored = database_.ReadPayload(state.row, record.seq);
  return stored && *stored != record.data;
}

void SubmapStore::OnRecord(const std::string& channel, const uint8_t* data, int size, int64_t now_ms) {
  const std::optional<RecordHeader> header = PeekHeader(data, size);
  SessionState* state = header ? FindOrAdd(header->session) : nullptr;
  if (state == nullptr) {
    ++num_refused_;
    return;
  }
  EncodedRecord record{header->session, header->seq, channel, std::vector<uint8_t>(data, data + size)};
  if (state->log.ClosedFrom() >= 0 && record.seq >= state->log.ClosedFrom()) {
    if (DecodeRecord(channel, data, size).record) TakeUpAgain(*state);
    return;
  }
  const bool is_conflict = IsConflict(*state, record);
  const SessionLog::Offered offered = state->log.Offer(std::move(record), now_ms);
  if (offered == SessionLog::Offered::kDuplicate) ++num_duplicates_;
  if (offered == SessionLog::Offered::kRefused || is_conflict) ++num_refused_;
}

void SubmapStore::OnHeartbeat(const StreamState& state, int64_t now_ms) {
  SessionState* session = IsSessionId(state.session) ? FindOrAdd(state.session) : nullptr;
  if (session == nullptr) {
    ++num_refused_;
    return;
  }
  const int64_t closed_from = session->log.ClosedFrom();
  const bool has_any = state.first >= 0 && state.first <= state.last;
  if (closed_from >= 0 && has_any && state.last >= closed_from) {
    TakeUpAgain(*session);
    return;
  }
  session->log.OnHeartbeat(state, now_ms);
}

// The session was closed in the absence of a frontend that has more of it.
void SubmapStore::TakeUpAgain(const SessionState& state) {
  if (!state.uncommitted.empty()) return;  // when the end that was made for it is in the file
  const int64_t from = state.log.ClosedFrom();
  try {
    SQLite::Transaction transaction(database_.Sql());
    for (const char* sql : {"DELETE FROM record WHERE session = ? AND seq >= ?",
                            "DELETE FROM gap WHERE session = ? AND first_seq >= ?"}) {
      auto remove = database_.Prepare(sql);
      remove->bind(1, state.row);
      remove->bind(2, from);
      remove->exec();
    }
    auto update = database_.Prepare("UPDATE session SET ended = 0, num_frames = 0, is_derived = 0 WHERE id = ?");
    update->bind(1, state.row);
    update->exec();
    transaction.commit();
  } catch (const SQLite::Exception& e) {
    spdlog::error("{}", Describe(e, options_.path));
    return;
  }
  spdlog::warn("{}: a session that was closed goes on: taken up again from record {}", options_.path, from);
  must_reload_ = true;
}

// A session of another vocabulary must not be mixed with what is there: its words mean other things.
void SubmapStore::CheckVocabulary(SessionState* state) {
  if (state->row != 0 || state->uncommitted.empty()) return;
  const auto* entry = std::get_if<LogEntry>(&state->uncommitted.front());
  const auto* start = entry == nullptr ? nullptr : std::get_if<SessionStarted>(&entry->record.body);
  if (start == nullptr) return;
  if (vocabulary_hash_.empty() || start->vocabulary_hash == vocabulary_hash_) return;
  const std::string error = "session " + entry->record.header.session + " uses vocabulary " + start->vocabulary_hash +
                            ", but " + options_.path + " is for vocabulary " + vocabulary_hash_;
  state->uncommitted.clear();
  state->log.RefuseSession(error);
}

void SubmapStore::Write(SessionState* state) {
  int64_t row = state->row;
  for (const LogItem& item : state->uncommitted) {
    if (const auto* gap = std::get_if<LogGap>(&item)) {
      auto insert = database_.Prepare(
          "INSERT OR IGNORE INTO gap(session, first_seq, last_seq, reason, checksum) VALUES(?1, ?2, ?3, ?4, "
          "row_checksum(?2, ?3, ?4))");
      insert->bind(1, row);
      insert->bind(2, gap->first_seq);
      insert->bind(3, gap->last_seq);
      insert->bind(4, gap->reason);
      insert->exec();
      continue;
    }
    const auto& [encoded, record] = std::get<LogEntry>(item);
    if (const auto* start = std::get_if<SessionStarted>(&record.body))
      row = InsertSession(&database_, record.header, *start);
    auto insert = database_.Prepare(
        "INSERT OR IGNORE INTO record(session, seq, channel, utime, payload, checksum) VALUES(?1, ?2, ?3, ?4, ?5, "
        "row_checksum(?3, ?5))");
    insert->bind(1, row);
    insert->bind(2, record.header.seq);
    insert->bind(3, encoded.channel);
    insert->bind(4, record.header.utime);
    insert->bindNoCopy(5, encoded.data.data(), static_cast<int>(encoded.data.size()));
    insert->exec();
    WriteDerivedRows(&database_, row, record);
  }
}

// What is in memory follows what is in the file.
void SubmapStore::AfterCommit(SessionState* state) {
  for (const LogItem& item : state->uncommitted) {
    if (const auto* gap = std::get_if<LogGap>(&item)) {
      num_gaps_ += gap->last_seq - gap->first_seq + 1;
      continue;
    }
    ++num_records_;
    const Record& record = std::get<LogEntry>(item).record;
    const int64_t seq = record.header.seq;
    if (std::holds_alternative<SessionStarted>(record.body)) {
      for (const SessionRow& row : database_.Sessions()) {
        if (row.uuid != record.header.session) continue;
        state->row = row.id;
        search_.AddSession(row);
        if (vocabulary_hash_.empty()) vocabulary_hash_ = row.vocabulary_hash;
      }
    } else if (const auto* start = std::get_if<SubmapStarted>(&record.body)) {
      search_.StartSubmap(state->row, start->submap, seq);
    } else if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body)) {
      search_.AddKeyframe(state->row, keyframe->submap, keyframe->keyframe, seq, keyframe->bow);
      if (on_keyframes_) on_keyframes_(record);
    } else if (const auto* update = std::get_if<MapUpdate>(&record.body)) {
      for (const KeyframeId id : update->removed_keyframes) search_.RemoveKeyframe(state->row, id, seq);
      if (on_keyframes_ && !update->removed_keyframes.empty()) on_keyframes_(record);
    } else if (const auto* end = std::get_if<SubmapEnded>(&record.body)) {
      search_.EndSubmap(state->row, end->submap, seq);
      Submap& submap = state->log.model()->submaps.at(end->submap);
      Submap stub;
      stub.id = submap.id;
      stub.ended = true;
      stub.last_frame = submap.last_frame;
      geometry_.emplace_back(state->row, std::exchange(submap, std::move(stub)));
    }
  }
  state->uncommitted.clear();
  state->log.Committed();
  search_.SetCumulative(state->row, state->log.Cumulative());
}

std::vector<std::string> SubmapStore::CommitReady(int64_t now_ms) {
  std::vector<std::string> changed;
  if (!error_.empty() && now_ms < retry_at_ms_) return changed;
  for (auto& [uuid, state] : sessions_) {
    if (error_.empty()) {
      for (LogItem& item : state->log.TakeReady(now_ms)) state->uncommitted.push_back(std::move(item));
      CheckVocabulary(state.get());
    }
    if (!state->uncommitted.empty()) changed.push_back(uuid);
  }
  if (changed.empty()) return changed;
  try {
    SQLite::Transaction transaction(database_.Sql());
    for (const std::string& uuid : changed) Write(sessions_.at(uuid).get());
    transaction.commit();
  } catch (const SQLite::Exception& e) {
    if (error_.empty()) spdlog::error("{}", Describe(e, options_.path));
    error_ = Describe(e, options_.path);
    retry_at_ms_ = now_ms + options_.retry_ms;
    return {};
  }
  if (!error_.empty()) spdlog::info("{}: storing again", options_.path);
  error_.clear();
  for (const std::string& uuid : changed) AfterCommit(sessions_.at(uuid).get());
  return changed;
}

bool SubmapStore::WorkInBackground() {
  if (geometry_.empty() || !error_.empty()) return false;
  GeometryWriter& writer = geometry_.front();
  try {
    if (!writer.Step(&database_)) return true;
  } catch (const SQLite::Exception& e) {
    spdlog::error("{}", Describe(e, options_.path));
    return false;
  }
  for (const auto& [id, keyframe] : writer.submap().keyframes) {
    std::vector<int32_t> covisible;
    for (const KeyframeId other : CovisibleKeyframes(writer.submap(), id)) covisible.push_back(other.value);
    search_.SetCovisible(writer.session(), id, covisible);
  }
  search_.FinishSubmap(writer.session(), writer.submap().id);
  geometry_.pop_front();
  return !geometry_.empty();
}

std::vector<std::tuple<std::string, KeyframeId, int>> SubmapStore::Keyframes() {
  std::vector<std::tuple<std::string, KeyframeId, int>> keyframes;
  auto rows = database_.Prepare(
      "SELECT uuid, keyframe, frame FROM keyframe JOIN session ON id = session WHERE removed_seq IS NULL");
  while (rows->executeStep()) {
    keyframes.emplace_back(rows->getColumn(0).getString(), KeyframeId(rows->getColumn(1).getInt()),
                           rows->getColumn(2).getInt());
  }
  return keyframes;
}

std::vector<StreamAck> SubmapStore::Acks(int64_t now_ms) const {
  std::vector<StreamAck> acks;
  for (const auto& [uuid, state] : sessions_) {
    if (state->log.WasHeard(now_ms, kAckWithinMs)) acks.push_back(state->log.MakeAck(error_));
  }
  return acks;
}

StreamAck SubmapStore::Ack(const std::string& session) const { return sessions_.at(session)->log.MakeAck(error_); }

FetchAnswer SubmapStore::Fetch(const FetchRequest& request) {
  FetchAnswer answer;
  answer.id = request.id;
  answer.requester = request.requester;
  answer.session = request.session;
  if (request.session.empty()) {
    for (const SessionRow& row : database_.Sessions()) answer.sessions.push_back({row.uuid, row.cumulative});
    return answer;
  }
  SessionState* state = Find(request.session);
  if (state == nullptr || state->row == 0) {
    answer.status = FetchAnswer::Status::kUnknownSession;
    return answer;
  }
  answer.cumulative = state->log.Cumulative();
  answer.ended = state->log.Ended() && state->uncommitted.empty();
  if (request.first_seq < 0 || request.last_seq < request.first_seq) {
    answer.status = FetchAnswer::Status::kBadRequest;
    return answer;
  }
  const auto limit = static_cast<size_t>(std::clamp(request.max_bytes, 1, kMaxFetchBytes));
  size_t num_bytes = 0;
  SessionRow row;
  row.id = state->row;
  row.uuid = request.session;
  database_.ReadRecords(
      row, request.first_seq, std::min(request.last_seq, answer.cumulative),
      [&](EncodedRecord record) {
        num_bytes += record.data.size();
        if (!answer.records.empty() && num_bytes > limit) return false;
        answer.records.push_back(std::move(record));
        return true;
      },
      // To a consumer it is a hole.
      [&](int64_t seq, const std::string& channel, const std::string& what) {
        if (!told_damaged_.insert({request.session, seq}).second) return;
        spdlog::error("{}: session {}, record {}{}: {}; it is left out", options_.path, request.session, seq,
                      DescribeChannel(channel), what);
      });
  return answer;
}

SessionProgress SubmapStore::Progress(const ProgressRequest& request) {
  SessionProgress answer;
  SessionState* state = Find(request.session);
  const bool is_known = state != nullptr && state->row != 0;
  if (is_known) {
    answer = ReadProgress(&database_, state->row, *state->log.model(), geometry_);
    answer.cumulative = state->log.Cumulative();
    answer.ended = state->log.Ended() && state->uncommitted.empty();
  }
  answer.status = is_known ? SessionProgress::Status::kOk : SessionProgress::Status::kUnknownSession;
  answer.id = request.id;
  answer.requester = request.requester;
  answer.session = request.session;
  return answer;
}

CloseAnswer SubmapStore::Close(const CloseRequest& request, int64_t now_ms) {
  CloseAnswer answer;
  answer.id = request.id;
  answer.requester = request.requester;
  answer.session = request.session;
  SessionState* state = Find(request.session);
  if (state == nullptr || state->row == 0) {
    answer.status = CloseAnswer::Status::kUnknownSession;
  } else if (!state->log.Ended() && state->log.IsAlive(now_ms)) {
    answer.status = CloseAnswer::Status::kStillAlive;
  } else {
    CommitReady(now_ms);
    for (LogItem& item : state->log.TakeClosing()) state->uncommitted.push_back(std::move(item));
    CommitReady(now_ms);
    answer.status = state->uncommitted.empty() ? CloseAnswer::Status::kOk : CloseAnswer::Status::kStillAlive;
    answer.cumulative = state->log.Cumulative();
  }
  return answer;
}

SubmapStore::Status SubmapStore::GetStatus(int64_t now_ms) const {
  Status status;
  status.error = error_;
  status.records = num_records_;
  status.keyframes = search_.NumKeyframes();
  status.duplicates = num_duplicates_;
  status.refused = num_refused_;
  status.gaps = num_gaps_;
  status.bytes_in_memory = search_.Bytes();
  for (const auto& [uuid, state] : sessions_) {
    status.refused += state->log.NumRefused();
    status.queue_depth += state->log.QueueDepth() + static_cast<int>(state->uncommitted.size());
    if (status.error.empty()) status.error = state->log.Error();
    if (state->row == 0) continue;
    status.cursors[uuid] = state->log.Cumulative();
    if (state->log.Ended()) continue;
    ++status.open_sessions;
    if (!state->log.IsAlive(now_ms)) ++status.silent_sessions;
  }
  return status;
}

}  // namespace mapmend
