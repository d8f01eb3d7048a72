#pragma once

#include <map>
#include <string>
#include <variant>
#include <vector>

#include "libs/base/range.h"
#include "libs/stream/stream_messages.h"
#include "libs/stream/submap.h"
#include "libs/wire/codec.h"

namespace mapmend {

struct SessionLogOptions {
  int max_ahead = 4096;                   // records beyond the next expected one that are held
  int64_t max_pending_bytes = 256 << 20;  // of those; what does not fit will be sent again
  // The stream is played by something that cannot answer (lcm-logplayer): a hole is given up after settle_ms. Else only
  // its sender can say that it no longer has a record; how long that takes does not matter, and no clock but the
  // store's own is looked at.
  bool is_recording = false;
  int64_t settle_ms = 2000;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_ahead", max_ahead, Range(1, 1e9), "records");
    v("max_pending_bytes", max_pending_bytes, Range(1, 1e12), "bytes");
    v("is_recording", is_recording);
    v("settle_ms", settle_ms, Range(0, 3.6e6), "ms");
  }
};

// The reason in the gap table when a store ends a session in its frontend's place: the gap begins with the first number
// that the store did not get from the frontend, and is empty (last = first - 1) if it had not heard of more.
inline constexpr char kClosedReason[] = "the session was closed in its frontend's absence";

// Something to be committed: a record that is the session's next and valid, or a hole that will not be filled.
struct LogEntry {
  EncodedRecord encoded;
  Record record;
};
struct LogGap {
  int64_t first_seq = 0, last_seq = 0;
  std::string reason;
};
using LogItem = std::variant<LogEntry, LogGap>;

// Of the frames that a session's records speak of.
struct SeenFrames {
  int first_frame = -1, last_frame = -1;  // indices, lowest and highest; -1: none
  int64_t last_utime = 0;
  void Note(int frame, int64_t utime);
};

// Puts the records of one session in order, as they come from an unreliable bus, and checks each in its turn against
// what came before. Knows nothing of files. Times are milliseconds of any steady clock.
class SessionLog {
 public:
  SessionLog(const std::string& session, const SessionLogOptions& options);
  // For a session that is in the file: model holds its submaps (only the open ones in full), cumulative its last seq.
  void Restore(Session model, int64_t cumulative, int32_t last_keyframe, const std::vector<LogGap>& gaps,
               const SeenFrames& seen);

  // A record that does not decode is refused here: it is sent again. If it does not decode then either, its turn makes
  // it a gap.
  enum class Offered { kPending, kDuplicate, kRefused };
  Offered Offer(EncodedRecord record, int64_t now_ms);
  void OnHeartbeat(const StreamState& state, int64_t now_ms);

  // Everything that can be committed now, in order. The caller commits it and then calls Committed, or tries again
  // later with the same items: they are handed out once.
  std::vector<LogItem> TakeReady(int64_t now_ms);
  void Committed();

  // Ends the session in its frontend's place: what is missing becomes a gap, open submaps are closed as "interrupted".
  std::vector<LogItem> TakeClosing();

  // The whole session is refused, e.g. another vocabulary: nothing of it is kept, acks carry the error, until another
  // first record comes that will do. Only before anything of it is committed.
  void RefuseSession(const std::string& error);

  StreamAck MakeAck(const std::string& store_error) const;
  bool IsAlive(int64_t now_ms) const;  // its frontend sends heartbeats
  bool WasHeard(int64_t now_ms, int64_t within_ms) const { return now_ms - last_heard_ms_ <= within_ms; }
  int64_t Cumulative() const { return committed_; }
  // The first number that came from TakeClosing rather than from the frontend; -1: none did. What the frontend has from
  // there on is not taken: the session must be taken up again first, without what TakeClosing made.
  int64_t ClosedFrom() const { return closed_from_; }
  bool Ended() const { return model_.ended; }
  int QueueDepth() const { return static_cast<int>(pending_.size()); }
  int64_t NumRefused() const { return num_refused_; }
  const std::string& Error() const { return session_error_; }
  Session* model() { return &model_; }

 private:
  void NoteFrames(const Record& record);
  void RefuseRecord(int64_t seq, const std::string& reason, std::vector<LogItem>* items);
  void AddGap(int64_t first, int64_t last, const std::string& reason, std::vector<LogItem>* items);
  bool IsHoleFinal(int64_t now_ms, std::string* reason) const;

  std::string session_;
  SessionLogOptions options_;
  Session model_;  // after all prepared records
  SeenFrames seen_;
  int32_t last_keyframe_ = -1;
  int64_t committed_ = -1;
  int64_t prepared_ = -1;  // handed out by TakeReady
  int64_t closed_from_ = -1;
  std::map<int64_t, LogEntry> pending_;
  struct Damaged {
    int count = 0;
    std::string error;
  };
  std::map<int64_t, Damaged> damaged_;  // records that came undecodable
  int64_t pending_bytes_ = 0;
  std::vector<LogGap> gaps_;
  int64_t first_available_ = 0, last_made_ = -1;  // as the frontend says
  int64_t last_heard_ms_ = -1000000000, last_heartbeat_ms_ = -1000000000, last_progress_ms_ = -1000000000;
  int64_t num_refused_ = 0;
  std::string session_error_;
};

}  // namespace mapmend
