#include "procs/submap_store/session_log.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "libs/stream/frames_read.h"
#include "procs/submap_store/submap_model.h"

namespace mapmend {
namespace {

constexpr int64_t kAliveMs = 2000;
constexpr int64_t kMaxBehind = 100000000;              // a heartbeat that claims more records is forged
constexpr int kMaxDamaged = 3;                         // a record that does not decode so often will not do better
constexpr size_t kMaxMissing = 64, kMaxGapSeqs = 256;  // named in an ack

}  // namespace

void SeenFrames::Note(int frame, int64_t utime) {
  if (frame >= 0 && (first_frame < 0 || frame < first_frame)) first_frame = frame;
  last_frame = std::max(last_frame, frame);
  last_utime = std::max(last_utime, utime);
}

SessionLog::SessionLog(const std::string& session, const SessionLogOptions& options)
    : session_(session), options_(options) {}

void SessionLog::Restore(Session model, int64_t cumulative, int32_t last_keyframe, const std::vector<LogGap>& gaps,
                         const SeenFrames& seen) {
  model_ = std::move(model);
  seen_ = seen;
  committed_ = prepared_ = cumulative;
  last_keyframe_ = last_keyframe;
  gaps_ = gaps;
  if (!gaps_.empty() && gaps_.back().reason == kClosedReason) closed_from_ = gaps_.back().first_seq;
}

SessionLog::Offered SessionLog::Offer(EncodedRecord encoded, int64_t now_ms) {
  last_heard_ms_ = now_ms;
  const int64_t seq = encoded.seq;
  if (seq <= prepared_ || pending_.contains(seq)) return Offered::kDuplicate;
  if (!session_error_.empty() && seq != 0) return Offered::kRefused;
  const auto size = static_cast<int64_t>(encoded.data.size());
  const bool is_next = seq == prepared_ + 1;
  if (seq > prepared_ + options_.max_ahead || (!is_next && pending_bytes_ + size > options_.max_pending_bytes)) {
    return Offered::kRefused;  // it will be sent again
  }
  DecodedRecord decoded = DecodeRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()));
  if (!decoded.record) {
    Damaged& damaged = damaged_[seq];
    damaged.error = decoded.error;
    if (++damaged.count == 1) spdlog::warn("session {}, record {}: {}", session_, seq, decoded.error);
    return Offered::kRefused;
  }
  damaged_.erase(seq);
  pending_bytes_ += size;
  pending_[seq] = {std::move(encoded), std::move(*decoded.record)};
  return Offered::kPending;
}

void SessionLog::OnHeartbeat(const StreamState& state, int64_t now_ms) {
  if (state.last < -1 || state.last > prepared_ + kMaxBehind || state.first < 0 || state.first > state.last + 1) {
    ++num_refused_;
    return;
  }
  last_heard_ms_ = now_ms;
  last_made_ = std::max(last_made_, state.last);
  // A recorded frontend talked to another store: what it could still send then says nothing about what comes now.
  if (options_.is_recording) return;
  last_heartbeat_ms_ = now_ms;
  first_available_ = std::max(first_available_, state.first);
}

bool SessionLog::IsAlive(int64_t now_ms) const { return now_ms - last_heartbeat_ms_ <= kAliveMs; }

void SessionLog::RefuseSession(const std::string& error) {
  if (error != session_error_) spdlog::error("{}", error);
  session_error_ = error;
  ++num_refused_;
  model_ = Session();
  seen_ = {};
  prepared_ = -1;
  last_keyframe_ = -1;
  pending_.clear();
  damaged_.clear();
  pending_bytes_ = 0;
}

void SessionLog::NoteFrames(const Record& record) {
  if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body)) {
    seen_.Note(keyframe->frame, record.header.utime);
  } else if (const auto* update = std::get_if<MapUpdate>(&record.body)) {
    for (const TrackedFrame& frame : update->frames) seen_.Note(frame.frame, frame.utime);
  } else if (const auto* end = std::get_if<SubmapEnded>(&record.body)) {
    seen_.Note(end->last_frame, end->last_utime);
  }
}

void SessionLog::AddGap(int64_t first, int64_t last, const std::string& reason, std::vector<LogItem>* items) {
  gaps_.push_back({first, last, reason});
  items->push_back(gaps_.back());
  prepared_ = last;
  if (last >= first) spdlog::warn("session {}: records {} to {} are missing: {}", session_, first, last, reason);
}

void SessionLog::RefuseRecord(int64_t seq, const std::string& reason, std::vector<LogItem>* items) {
  ++num_refused_;
  AddGap(seq, seq, "refused: " + reason, items);
}

bool SessionLog::IsHoleFinal(int64_t now_ms, std::string* reason) const {
  if (pending_.empty() && last_made_ <= prepared_) return false;  // no hole
  if (!options_.is_recording) {
    *reason = "the frontend no longer has them";
    return first_available_ > prepared_ + 1;
  }
  *reason = "not in the recording";
  // At the tail, more may come as long as the recording goes on.
  return now_ms - (pending_.empty() ? last_heard_ms_ : last_progress_ms_) > options_.settle_ms;
}

std::vector<LogItem> SessionLog::TakeReady(int64_t now_ms) {
  std::vector<LogItem> items;
  if (!session_error_.empty() && !pending_.contains(0)) return items;
  for (;;) {
    if (pending_.empty() || pending_.begin()->first > prepared_ + 1) {
      if (last_progress_ms_ < 0) last_progress_ms_ = now_ms;
      const auto damaged = damaged_.find(prepared_ + 1);
      if (damaged != damaged_.end() && damaged->second.count >= kMaxDamaged) {
        if (prepared_ < 0) {
          RefuseSession("session " + session_ + ": its first record is refused: " + damaged->second.error);
          break;
        }
        RefuseRecord(prepared_ + 1, "it does not decode", &items);
        damaged_.erase(damaged);
        continue;
      }
      std::string reason;
      if (!IsHoleFinal(now_ms, &reason)) break;
      int64_t last = pending_.empty() ? last_made_ : pending_.begin()->first - 1;
      if (first_available_ > prepared_ + 1) last = std::min(std::max(last, prepared_ + 1), first_available_ - 1);
      if (prepared_ < 0) {
        RefuseSession("session " + session_ + ": its first record is missing, so nothing of it can be stored (" +
                      reason + ")");
        break;
      }
      AddGap(prepared_ + 1, last, reason, &items);
      damaged_.erase(damaged_.begin(), damaged_.upper_bound(last));
      last_progress_ms_ = now_ms;
      continue;
    }
    LogEntry entry = std::move(pending_.begin()->second);
    pending_.erase(pending_.begin());
    pending_bytes_ -= static_cast<int64_t>(entry.encoded.data.size());
    last_progress_ms_ = now_ms;
    const auto* keyframe = std::get_if<KeyframeRecord>(&entry.record.body);
    const bool grows = keyframe == nullptr || keyframe->keyframe.value > last_keyframe_;
    const std::string error = grows ? ApplyLight(entry.record, &model_)
                                    : "keyframe id " + std::to_string(keyframe->keyframe.value) + " does not grow";
    if (error.empty()) {
      if (keyframe != nullptr) last_keyframe_ = keyframe->keyframe.value;
      NoteFrames(entry.record);
      prepared_ = entry.encoded.seq;
      session_error_.clear();
      items.emplace_back(std::move(entry));
    } else if (prepared_ < 0) {
      RefuseSession("session " + session_ + ": its first record is refused: " + error);
      break;
    } else {
      RefuseRecord(entry.encoded.seq, error, &items);
    }
  }
  return items;
}

void SessionLog::Committed() { committed_ = prepared_; }

std::vector<LogItem> SessionLog::TakeClosing() {
  std::vector<LogItem> items;
  if (model_.ended || prepared_ < 0) return items;
  const int64_t last_heard_of = std::max(last_made_, pending_.empty() ? -1 : pending_.rbegin()->first);
  closed_from_ = prepared_ + 1;
  AddGap(closed_from_, std::max(prepared_, last_heard_of), kClosedReason, &items);
  pending_.clear();
  pending_bytes_ = 0;
  const int64_t last_utime = std::max(model_.start_utime, seen_.last_utime);
  const auto append = [&](RecordBody body) {
    Record record{{session_, prepared_ + 1, last_utime}, std::move(body)};
    if (!ApplyLight(record, &model_).empty()) return;
    ++prepared_;
    EncodedRecord encoded = EncodeRecord(record);
    items.push_back(LogEntry{std::move(encoded), std::move(record)});
  };
  for (const auto& [id, submap] : model_.submaps) {
    if (!submap.ended)
      append(SubmapEnded{id, "interrupted", "the frontend ended without a word", seen_.last_frame, last_utime});
  }
  append(SessionEnded{CountFramesRead(model_.info, seen_.first_frame, seen_.last_frame)});
  return items;
}

StreamAck SessionLog::MakeAck(const std::string& store_error) const {
  StreamAck ack;
  ack.session = session_;
  // What the frontend may still have must not be acknowledged to it.
  ack.cumulative = closed_from_ >= 0 ? std::min(committed_, closed_from_ - 1) : committed_;
  ack.error = session_error_.empty() ? store_error : session_error_;
  // Holes that were given up come first: consumers must not deliver what they may have heard of them.
  for (auto gap = gaps_.rbegin(); gap != gaps_.rend() && ack.missing.size() < kMaxGapSeqs; ++gap) {
    for (int64_t seq = gap->last_seq; seq >= gap->first_seq && ack.missing.size() < kMaxGapSeqs; --seq) {
      if (seq <= committed_) ack.missing.push_back(seq);
    }
  }
  if (ack.error.empty()) {
    const int64_t end = std::max(last_made_, pending_.empty() ? -1 : pending_.rbegin()->first);
    size_t num_holes = 0;
    for (int64_t seq = prepared_ + 1; seq <= end && num_holes < kMaxMissing; ++seq) {
      if (pending_.contains(seq)) continue;
      ack.missing.push_back(seq);
      ++num_holes;
    }
  }
  return ack;
}

}  // namespace mapmend
