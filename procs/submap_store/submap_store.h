#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "procs/submap_store/bow_search.h"
#include "procs/submap_store/checkpointer.h"
#include "procs/submap_store/database.h"
#include "procs/submap_store/derived_tables.h"
#include "procs/submap_store/edge_decisions.h"
#include "procs/submap_store/revision_store.h"
#include "procs/submap_store/session_log.h"

namespace mapmend {

struct SubmapStoreOptions {
  std::string path;
  std::string vocabulary_hash;  // sessions with another one are refused; empty: that of the first session in the file
  SessionLogOptions log;
  BowSearchOptions retrieval;
  int checkpoint_interval_ms = 200;
  int64_t retry_ms = 250;  // after a failed commit, e.g. on a full disk

  // Not visited: path, vocabulary_hash: of one map.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("log", log);
    v("retrieval", retrieval);
    v("checkpoint_interval_ms", checkpoint_interval_ms, Range(1, 3.6e6), "ms");
    v("retry_ms", retry_ms, Range(1, 3.6e6), "ms");
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// The durable log of the stream and the retrieval over it. Knows no bus: records and questions go in, answers come out.
// A record is acknowledged only after it is committed. One thread. Times are milliseconds of a steady clock.
class SubmapStore {
 public:
  // Opens or creates the file and rebuilds what is in memory. Throws std::runtime_error with one line if the file
  // cannot be used, or holds sessions of another vocabulary.
  explicit SubmapStore(const SubmapStoreOptions& options);

  // The stream.
  void OnRecord(const std::string& channel, const uint8_t* data, int size, int64_t now_ms);
  void OnHeartbeat(const StreamState& state, int64_t now_ms);
  // Commits what has come in order, in one transaction. Returns the sessions that went forward (to be acknowledged).
  std::vector<std::string> CommitReady(int64_t now_ms);
  // True once a session that was closed in its frontend's absence has been taken up again, because the frontend turned
  // out to have more of it: this object is of no use any more, another one must be made of the file.
  bool MustReload() const { return must_reload_; }
  // Throws FileGone if the file was removed or replaced. Call once a second.
  void CheckPlace() { database_.CheckPlace(); }
  // Does a little of what can wait. True if there is more.
  bool WorkInBackground();
  // Of sessions heard of in the last two seconds.
  std::vector<StreamAck> Acks(int64_t now_ms) const;
  StreamAck Ack(const std::string& session) const;

  // Called after the commit of a record that adds or removes keyframes.
  using OnKeyframes = std::function<void(const Record& record)>;
  void SetListener(OnKeyframes listener) { on_keyframes_ = std::move(listener); }
  // Keyframes that were not culled, with their frames.
  std::vector<std::tuple<std::string, KeyframeId, int>> Keyframes();

  // Requests.
  BowAnswer Query(const BowQuery& query) { return search_.Query(query); }
  FetchAnswer Fetch(const FetchRequest& request);
  SessionProgress Progress(const ProgressRequest& request);
  CloseAnswer Close(const CloseRequest& request, int64_t now_ms);
  RevisionStore* revisions() { return &revisions_; }
  EdgeDecisions* edge_decisions() { return &edge_decisions_; }

  struct Status {
    std::string error;  // empty, or why nothing is committed
    std::map<std::string, int64_t> cursors;
    int64_t records = 0, keyframes = 0, duplicates = 0, refused = 0, gaps = 0, bytes_in_memory = 0;
    int open_sessions = 0;
    int silent_sessions = 0;  // open, but their frontend sends no heartbeats
    int queue_depth = 0;
  };
  Status GetStatus(int64_t now_ms) const;

 private:
  struct SessionState {
    explicit SessionState(const std::string& uuid, const SessionLogOptions& options) : log(uuid, options) {}
    SessionLog log;
    int64_t row = 0;  // 0: not in the file yet
    std::vector<LogItem> uncommitted;
  };

  void Restore(const SessionRow& row);
  SessionState* Find(const std::string& session);
  SessionState* FindOrAdd(const std::string& session);
  void CheckVocabulary(SessionState* state);
  void Write(SessionState* state);
  void AfterCommit(SessionState* state);
  bool IsConflict(const SessionState& state, const EncodedRecord& record);
  void TakeUpAgain(const SessionState& state);

  SubmapStoreOptions options_;
  Database database_;
  BowSearch search_;
  RevisionStore revisions_;
  EdgeDecisions edge_decisions_;
  Checkpointer checkpointer_;
  std::map<std::string, std::unique_ptr<SessionState>> sessions_;
  std::deque<GeometryWriter> geometry_;  // submaps that have ended
  std::string vocabulary_hash_, error_;
  std::set<std::pair<std::string, int64_t>> told_damaged_;
  OnKeyframes on_keyframes_;
  int64_t retry_at_ms_ = 0;
  bool must_reload_ = false;
  int64_t num_records_ = 0, num_duplicates_ = 0, num_refused_ = 0, num_gaps_ = 0;
};

}  // namespace mapmend
