#include "libs/bus/send_window.h"

#include <algorithm>
#include <utility>

namespace mapmend {

void SendWindow::Add(EncodedRecord record) {
  bytes_ += static_cast<int64_t>(record.data.size());
  const int64_t seq = record.seq;
  entries_[seq].record = std::move(record);
}

void SendWindow::Acknowledge(int64_t cumulative, Clock::time_point now) {
  while (!entries_.empty() && entries_.begin()->first <= cumulative) {
    const Entry& entry = entries_.begin()->second;
    // A record that was sent again counts from its first sending: rather too long than too short.
    if (entry.is_timed) timer_.OnAcknowledged(now - entry.first_sent);
    bytes_ -= static_cast<int64_t>(entry.record.data.size());
    entries_.erase(entries_.begin());
    last_progress_ = now;
  }
}

void SendWindow::OnMissing(const std::vector<int64_t>& missing) {
  if (missing.empty()) return;
  std::vector<int64_t> seqs = missing;
  std::sort(seqs.begin(), seqs.end());
  int64_t newest_held = -1;  // sending of what the store has for certain: it names something behind it, but not it
  for (auto it = entries_.begin(); it != entries_.end() && it->first < seqs.back(); ++it) {
    if (!std::binary_search(seqs.begin(), seqs.end(), it->first) && it->second.is_sent)
      newest_held = std::max(newest_held, it->second.sending);
  }
  for (const int64_t seq : seqs) {
    const auto it = entries_.find(seq);
    if (it == entries_.end()) continue;
    it->second.is_asked = true;
    it->second.is_lost = it->second.is_sent && (it->second.sending < newest_held || it->second.is_of_old_connection);
  }
}

void SendWindow::OnNewConnection() {
  timer_.Reset();
  for (auto& [seq, entry] : entries_) {
    entry.is_timed = false;
    entry.is_of_old_connection = entry.is_sent;
    entry.num_attempts = 0;
  }
}

// Each attempt waits twice as long as the one before: the measured times are of records that were sent once.
std::chrono::milliseconds SendWindow::Patience(const Entry& entry) const {
  constexpr std::chrono::milliseconds kMost(60000);
  return std::min(kMost, timer_.Timeout() * (1 << std::clamp(entry.num_attempts - 1, 0, 10)));
}

void SendWindow::SendDue(Clock::time_point now, const std::function<bool(const EncodedRecord&)>& send) {
  bool is_first = true;
  for (auto& [seq, entry] : entries_) {
    const bool is_oldest = std::exchange(is_first, false);
    if (entry.is_sent && !entry.is_lost) {
      // As long as those before it arrive, it is behind them.
      const auto since = now - std::max(entry.last_sent, last_progress_);
      const bool is_due =
          entry.is_asked ? since >= Patience(entry) : is_oldest && since >= std::max(resend_unasked_, Patience(entry));
      if (!is_due) continue;
    }
    if (!send(entry.record)) return;
    entry.last_sent = now;
    entry.sending = ++num_sendings_;
    // Whether the store has what went over the connection before is known only when it has said so.
    if (!entry.is_sent || (entry.is_of_old_connection && entry.is_asked)) {
      entry.is_sent = entry.is_timed = true;
      entry.first_sent = now;
    }
    entry.is_asked = entry.is_lost = entry.is_of_old_connection = false;
    ++entry.num_attempts;
  }
}

}  // namespace mapmend
