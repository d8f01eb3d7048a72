#include "libs/wire/send_window.h"

#include <algorithm>
#include <utility>

namespace mapmend {
namespace {

constexpr std::chrono::milliseconds kMostPatience(60000);
constexpr int kMostAtOnce = 64;

}  // namespace

void SendWindow::Add(EncodedRecord record) {
  bytes_ += static_cast<int64_t>(record.data.size());
  const int64_t seq = record.seq;
  entries_[seq].record = std::move(record);
}

void SendWindow::Acknowledge(int64_t cumulative, Clock::time_point now) {
  while (!entries_.empty() && entries_.begin()->first <= cumulative) {
    const Entry& entry = entries_.begin()->second;
    // Of one that was sent twice nobody knows which sending has come (Karn's algorithm, as in TCP).
    if (entry.is_timed && entry.num_attempts == 1) {
      timer_.OnAcknowledged(now - entry.first_sent);
      backoff_ = 0;
    }
    burst_ = entry.num_attempts > 1 ? std::min(2 * burst_, kMostAtOnce) : 1;
    newest_come_ = std::max(newest_come_, entry.first_sending);
    bytes_ -= static_cast<int64_t>(entry.record.data.size());
    entries_.erase(entries_.begin());
    last_progress_ = now;
  }
}

void SendWindow::OnMissing(const std::vector<int64_t>& missing) {
  if (missing.empty()) return;
  std::vector<int64_t> seqs = missing;
  std::sort(seqs.begin(), seqs.end());
  // What the store has for certain: it names something behind it, but not it.
  for (auto it = entries_.begin(); it != entries_.end() && it->first < seqs.back(); ++it) {
    if (!std::binary_search(seqs.begin(), seqs.end(), it->first) && it->second.is_sent)
      newest_come_ = std::max(newest_come_, it->second.first_sending);
  }
  for (const int64_t seq : seqs) {
    const auto it = entries_.find(seq);
    if (it == entries_.end()) continue;
    Entry& entry = it->second;
    entry.is_asked = true;
    entry.is_lost = entry.is_sent && (entry.sending < newest_come_ || entry.is_of_old_peer);
  }
}

void SendWindow::OnNewPeer() {
  timer_.Reset();
  backoff_ = 0;
  burst_ = 1;
  for (auto& [seq, entry] : entries_) {
    entry.is_timed = false;
    entry.is_of_old_peer = entry.is_sent;
  }
}

bool SendWindow::Send(Entry* entry, Clock::time_point now, const Sending& send) {
  if (!send(entry->record)) return false;
  entry->last_sent = now;
  entry->sending = ++num_sendings_;
  ++entry->num_attempts;
  // Whether the store has what went over the connection before is known only when it has said so.
  if (!entry->is_sent || (entry->is_of_old_peer && entry->is_asked)) {
    entry->is_sent = entry->is_timed = true;
    entry->first_sent = now;
    entry->first_sending = entry->sending;
    entry->num_attempts = 1;
  }
  entry->is_asked = entry->is_lost = entry->is_of_old_peer = false;
  return true;
}

void SendWindow::SendDue(Clock::time_point now, const Sending& send) {
  for (auto& [seq, entry] : entries_) {
    if ((!entry.is_sent || entry.is_lost) && !Send(&entry, now, send)) return;
  }
  if (entries_.empty()) return;
  // The oldest may be lost, or only slow: as long as those before it came, it was behind them.
  const Entry& oldest = entries_.begin()->second;
  const auto patience = std::min(kMostPatience, timer_.Timeout() * (1 << std::min(backoff_, 10)));
  if (now - std::max(oldest.last_sent, last_progress_) <
      (oldest.is_asked ? patience : std::max(resend_unasked_, patience)))
    return;
  ++backoff_;
  int num_sent = 0;
  for (auto& [seq, entry] : entries_) {
    if (num_sent > 0 && (num_sent >= burst_ || !entry.is_asked)) return;
    if (!Send(&entry, now, send)) return;
    ++num_sent;
  }
}

}  // namespace mapmend
