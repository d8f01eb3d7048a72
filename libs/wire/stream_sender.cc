#include "libs/wire/stream_sender.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "libs/bus/channels.h"
#include "libs/wire/codec.h"
#include "libs/wire/outbox.h"
#include "libs/wire/record_checksums.h"
#include "libs/wire/send_window.h"
#include "libs/wire/stream_codec.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

// Written down by whoever records the stream; no decision depends on it.
int64_t WallUs() {
  return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

struct StreamSender::Impl {
  Bus* bus;
  const std::string session;
  const StreamSenderOptions options;

  mutable std::mutex mutex;  // guards all up to the empty line; never held while anything waits
  std::condition_variable progress;
  std::deque<EncodedRecord> queue;  // appended, not yet in the outbox
  int64_t queue_bytes = 0;
  int64_t last_seq = -1, acknowledged = -1;
  std::string store_error;
  bool was_acknowledged = false;      // an ack has come over this connection
  std::optional<int64_t> renumbered;  // by ContinueAfter; the sender's thread takes it over

  // Of the sender's thread.
  Outbox outbox;
  int64_t last_kept = -1;  // in the outbox, or was
  int64_t inherited = -1;  // the last one that an earlier life had left there
  bool ended = false;      // last_kept is SESSION ENDED
  SendWindow window;
  RecordChecksums checksums;
  int64_t connection = -1;
  Clock::time_point connected_at;
  bool store_was_heard = false;  // by this life of the sender
  Clock::time_point last_heartbeat, last_sync;
  std::atomic<bool> stop{false};
  std::thread thread;
  int64_t store_incarnation = -1;  // -1: not heard of yet
  Subscription acks, starts;

  Impl(Bus* b, const std::string& s, const StreamSenderOptions& o)
      : bus(b), session(s), options(o), outbox(o.outbox_path, o.max_memory_bytes), window(o.resend_unasked_ms) {
    if (!IsSessionId(session))
      throw std::invalid_argument("session '" + session + "': 1 to 64 letters, digits, - or _");
    if (outbox.Session() != session && outbox.Empty()) return;
    if (outbox.Session() != session) {
      throw std::runtime_error("outbox " + options.outbox_path + ": still holds records of session " +
                               outbox.Session() + "; deliver them first");
    }
    // A frontend that was killed goes on where its outbox ends.
    last_seq = last_kept = inherited = outbox.LastSeq();
    acknowledged = outbox.Empty() ? last_seq : outbox.FirstSeq() - 1;
    if (const auto last = outbox.Read(last_seq)) ended = IsEnd(*last);
  }

  static bool IsEnd(const EncodedRecord& record) {
    if (record.channel != channels::kSession) return false;
    const DecodedRecord decoded =
        DecodeRecord(record.channel, record.data.data(), static_cast<int>(record.data.size()));
    return decoded.record && std::holds_alternative<SessionEnded>(decoded.record->body);
  }

  // Inside Handle, on the sender's thread.
  void OnAck(const StreamAck& ack) {
    if (ack.session != session) return;
    // A store that has more than we have ever made knows of earlier lives of this session: a power cut took the end of
    // the outbox, or the flight was flown again. What we have inherited is among it; of what we made, it says nothing.
    const bool is_ours = ack.cumulative <= last_kept;
    const int64_t cumulative = is_ours ? ack.cumulative : inherited;
    if (cumulative >= 0) {
      outbox.Acknowledge(cumulative);
      window.Acknowledge(cumulative, Clock::now());
    }
    if (is_ours) window.OnMissing(ack.missing);
    store_was_heard = true;
    const std::lock_guard<std::mutex> lock(mutex);
    was_acknowledged = true;
    acknowledged = std::max(acknowledged, cumulative);
    if (ack.error != store_error) {
      store_error = ack.error;
      if (!store_error.empty()) spdlog::error("submap_store: {}", store_error);
    }
    progress.notify_all();
  }

  // Inside Handle, as the next.
  void OnStoreStarted(const StoreStarted& message) {
    if (store_incarnation >= 0 && store_incarnation != message.incarnation) window.OnNewPeer();
    store_incarnation = message.incarnation;
  }

  // From the queue to the outbox; may wait for the disk.
  void KeepAppended() {
    for (;;) {
      EncodedRecord record;
      {
        const std::lock_guard<std::mutex> lock(mutex);
        if (renumbered) last_kept = *std::exchange(renumbered, std::nullopt);
        if (queue.empty()) break;
        record = std::move(queue.front());
        queue.pop_front();
        queue_bytes -= static_cast<int64_t>(record.data.size());
      }
      ended = IsEnd(record);
      last_kept = record.seq;
      outbox.Append(std::move(record));
    }
    const auto now = Clock::now();
    if (now - last_sync < std::chrono::milliseconds(options.sync_ms)) return;
    last_sync = now;
    outbox.Sync();
  }

  void FillWindow() {
    while (window.Size() < options.window && window.Bytes() < options.window_bytes) {
      const int64_t next = outbox.NextSeq(window.Empty() ? -1 : window.LastSeq());
      if (next < 0) return;
      std::optional<EncodedRecord> record = outbox.Read(next);
      if (!record) {
        spdlog::error("outbox {}: record {} cannot be read and is given up", options.outbox_path, next);
        outbox.GiveUp(next);
        continue;
      }
      window.Add(std::move(*record));
    }
  }

  void SendDue() {
    if (const int64_t number = bus->ConnectionNumber(); number != connection) {
      connection = number;
      connected_at = Clock::now();
      window.OnNewPeer();
      const std::lock_guard<std::mutex> lock(mutex);
      was_acknowledged = false;
    }
    // What an earlier life left may long be there: the answer to a heartbeat tells, and spares a slow link megabytes.
    const bool may_be_there = !store_was_heard && !outbox.Empty() && outbox.FirstSeq() <= inherited;
    if (may_be_there && Clock::now() - connected_at < std::chrono::milliseconds(options.resend_unasked_ms)) return;
    window.SendDue(Clock::now(), [this](const EncodedRecord& record) {
      bus->Publish(channels::kChecksum, checksums.Of(record));
      return bus->PublishRaw(record.channel, record.data.data(), static_cast<int>(record.data.size()));
    });
  }

  // `first` is what we still have: below it, whatever the store lacks is lost.
  void SendHeartbeat() {
    const auto now = Clock::now();
    if (now - last_heartbeat < std::chrono::milliseconds(options.heartbeat_ms)) return;
    last_heartbeat = now;
    StreamState state;
    state.session = session;
    state.first = outbox.Empty() ? last_kept + 1 : outbox.FirstSeq();
    state.last = last_kept;
    state.ended = ended;
    state.utime = WallUs();
    bus->Publish(channels::kStreamState, state);
  }

  void Run() {
    while (!stop) {
      try {
        KeepAppended();
        SendHeartbeat();
        FillWindow();
        SendDue();
        bus->Handle(window.Empty() ? 5 : 2);
      } catch (const std::exception& e) {
        spdlog::error("stream sender: {}", e.what());
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
      }
    }
    KeepAppended();
    outbox.Sync();
  }
};

StreamSender::StreamSender(Bus* bus, const std::string& session, const StreamSenderOptions& options)
    : impl_(std::make_unique<Impl>(bus, session, options)) {
  impl_->acks = bus->Subscribe<StreamAck>(channels::kAck, Delivery::kKeepAll,
                                          [impl = impl_.get()](const StreamAck& ack) { impl->OnAck(ack); });
  impl_->starts = bus->Subscribe<StoreStarted>(
      channels::kStoreStarted, Delivery::kKeepAll,
      [impl = impl_.get()](const StoreStarted& message) { impl->OnStoreStarted(message); });
  impl_->thread = std::thread([impl = impl_.get()] { impl->Run(); });
}

StreamSender::~StreamSender() {
  impl_->stop = true;
  impl_->thread.join();
}

int64_t StreamSender::Append(int64_t utime, RecordBody body) {
  Record record{{impl_->session, -1, utime}, std::move(body)};
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  record.header.seq = impl_->last_seq + 1;
  EncodedRecord encoded = EncodeRecord(record);  // may throw: then it has no number
  ++impl_->last_seq;
  impl_->queue_bytes += static_cast<int64_t>(encoded.data.size());
  impl_->queue.push_back(std::move(encoded));
  while (impl_->queue_bytes > impl_->options.max_queue_bytes && impl_->queue.size() > 1) {
    const EncodedRecord& oldest = impl_->queue.front();
    spdlog::error("outbox {}: the disk does not take anything, and memory is full: record {} is given up",
                  impl_->options.outbox_path, oldest.seq);
    impl_->queue_bytes -= static_cast<int64_t>(oldest.data.size());
    impl_->queue.pop_front();
  }
  return record.header.seq;
}

bool StreamSender::Flush(int timeout_ms) {
  std::unique_lock<std::mutex> lock(impl_->mutex);
  int64_t before = impl_->acknowledged;
  auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
  while (impl_->acknowledged < impl_->last_seq) {
    if (impl_->progress.wait_until(lock, deadline) == std::cv_status::timeout && impl_->acknowledged == before)
      return false;
    if (impl_->acknowledged > before) {
      before = impl_->acknowledged;
      deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
    }
  }
  return true;
}

void StreamSender::ContinueAfter(int64_t seq) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  if (impl_->acknowledged < impl_->last_seq) throw std::logic_error("StreamSender::ContinueAfter: records wait");
  impl_->last_seq = impl_->acknowledged = seq;
  impl_->renumbered = seq;
}

int64_t StreamSender::LastSeq() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->last_seq;
}

int64_t StreamSender::AcknowledgedSeq() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->acknowledged;
}

std::string StreamSender::StoreError() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->store_error;
}

std::string StreamSender::Obstacle() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  if (!impl_->bus->IsConnected()) return "no connection to the hub";
  if (!impl_->was_acknowledged) return "the submap store does not answer";
  if (!impl_->store_error.empty()) return "the submap store says: " + impl_->store_error;
  return "the submap store is slow";
}

bool DeliverOutbox(Bus* bus, const std::string& path, int timeout_ms) {
  std::string session;
  {
    const Outbox outbox(path);
    if (outbox.Empty()) return true;
    session = outbox.Session();
  }
  StreamSenderOptions options;
  options.outbox_path = path;
  StreamSender sender(bus, session, options);
  return sender.Flush(timeout_ms);
}

}  // namespace mapmend
