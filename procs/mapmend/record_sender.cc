#include "procs/mapmend/record_sender.h"

#include <algorithm>

#include "libs/bus/channels.h"
#include "libs/wire/stream_codec.h"

namespace mapmend {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kHeartbeat(50), kResendAfter(100);

}  // namespace

RecordSender::RecordSender(Bus* bus) : bus_(bus) {
  acks_ = bus_->Subscribe<StreamAck>(channels::kAck, Delivery::kKeepAll, [this](const StreamAck& ack) {
    const auto session = sessions_.find(ack.session);
    if (session == sessions_.end()) return;
    store_error_ = ack.error;
    auto& pending = session->second.pending;
    while (!pending.empty() && pending.front().record.seq <= ack.cumulative) {
      pending.pop_front();
      --num_pending_;
    }
  });
}

void RecordSender::Publish(const EncodedRecord& record) {
  bus_->PublishRaw(record.channel, record.data.data(), static_cast<int>(record.data.size()));
}

void RecordSender::Send(EncodedRecord record) {
  Session& session = sessions_[record.session];
  Publish(record);
  session.last = record.seq;
  session.pending.push_back({std::move(record), Clock::now()});
  ++num_pending_;
}

void RecordSender::Tick() {
  const auto now = Clock::now();
  for (auto& [id, session] : sessions_) {
    for (Pending& pending : session.pending) {
      if (now - pending.sent < kResendAfter * std::min(pending.num_sent, 10)) continue;
      Publish(pending.record);
      pending.sent = now;
      ++pending.num_sent;
    }
  }
  if (now - last_heartbeat_ < kHeartbeat) return;
  last_heartbeat_ = now;
  for (const auto& [id, session] : sessions_) {
    StreamState state;
    state.session = id;
    state.first = session.pending.empty() ? session.last + 1 : session.pending.front().record.seq;
    state.last = session.last;
    state.utime =
        std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
            .count();
    bus_->Publish(channels::kStreamState, state);
  }
}

}  // namespace mapmend
