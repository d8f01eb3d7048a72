#include "libs/bus/stream_sender.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <map>
#include <mapmend/ack_t.hpp>
#include <mapmend/stream_state_t.hpp>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "libs/bus/channels.h"
#include "libs/bus/codec.h"
#include "libs/bus/outbox.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kMaxResendMs = 2000;

int64_t WallUs() {
  return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

struct StreamSender::Impl {
  // A record of the window: sent, not yet acknowledged.
  struct InFlight {
    EncodedRecord record;
    Clock::time_point last_sent;
    int attempts = 0;
    bool asked = false;  // the store said that it is missing
  };

  Bus* bus;
  const std::string session;
  const StreamSenderOptions options;

  mutable std::mutex mutex;  // guards all below
  std::condition_variable progress;
  Outbox outbox;
  int64_t last_seq = -1, acknowledged = -1;
  bool ended = false;
  std::string store_error;

  std::map<int64_t, InFlight> window;  // network thread only
  Clock::time_point last_heartbeat;
  std::atomic<bool> stop{false};
  std::thread thread;
  std::shared_ptr<char> alive = std::make_shared<char>();  // the bus may outlive us and still have our handler

  Impl(Bus* b, const std::string& s, const StreamSenderOptions& o)
      : bus(b), session(s), options(o), outbox(o.outbox_path) {
    if (!IsSessionId(session))
      throw std::invalid_argument("session '" + session + "': 1 to 64 letters, digits, - or _");
    if (outbox.Session() != session && outbox.Empty()) return;
    if (outbox.Session() != session) {
      throw std::runtime_error("outbox " + options.outbox_path + ": still holds records of session " +
                               outbox.Session() + "; deliver them first");
    }
    // A frontend that was killed goes on where its outbox ends.
    last_seq = outbox.LastSeq();
    acknowledged = outbox.Empty() ? last_seq : outbox.FirstSeq() - 1;
    if (const auto last = outbox.Read(last_seq)) {
      const DecodedRecord decoded = DecodeRecord(last->channel, last->data.data(), static_cast<int>(last->data.size()));
      ended = decoded.record && std::holds_alternative<SessionEnded>(decoded.record->body);
    }
  }

  void OnAck(const ack_t& ack) {
    if (ack.session != session) return;
    const std::lock_guard<std::mutex> lock(mutex);
    if (ack.cumulative > last_seq) return;  // not about what we sent
    if (ack.cumulative > acknowledged) {
      acknowledged = ack.cumulative;
      outbox.Acknowledge(acknowledged);
      window.erase(window.begin(), window.upper_bound(acknowledged));
    }
    for (const int64_t seq : ack.missing) {
      const auto it = window.find(seq);
      if (it != window.end()) it->second.asked = true;
    }
    if (ack.error != store_error) {
      store_error = ack.error;
      if (!store_error.empty()) spdlog::error("submap_store: {}", store_error);
    }
    progress.notify_all();
  }

  // Moves records from the outbox into the window.
  void FillWindow() {
    const std::lock_guard<std::mutex> lock(mutex);
    int64_t next = window.empty() ? acknowledged + 1 : window.rbegin()->first + 1;
    while (next <= last_seq && static_cast<int>(window.size()) < options.window) {
      std::optional<EncodedRecord> record = outbox.Read(next);
      if (!record)
        throw std::runtime_error("outbox " + options.outbox_path + ": record " + std::to_string(next) +
                                 " cannot be read");
      window[next].record = std::move(*record);
      ++next;
    }
  }

  void SendDue() {
    const auto now = Clock::now();
    for (auto& [seq, entry] : window) {
      if (entry.attempts > 0) {
        const auto wait = std::chrono::milliseconds(
            entry.asked ? options.resend_after_ms : std::min(kMaxResendMs, options.resend_unasked_ms * entry.attempts));
        if (now - entry.last_sent < wait) continue;
      }
      const EncodedRecord& record = entry.record;
      if (!bus->PublishRaw(record.channel, record.data.data(), static_cast<int>(record.data.size()))) return;
      entry.last_sent = Clock::now();
      entry.asked = false;
      ++entry.attempts;
    }
  }

  void SendHeartbeat() {
    const auto now = Clock::now();
    if (now - last_heartbeat < std::chrono::milliseconds(options.heartbeat_ms)) return;
    last_heartbeat = now;
    stream_state_t state{};
    {
      const std::lock_guard<std::mutex> lock(mutex);
      state.session = session;
      state.first = acknowledged + 1;
      state.last = last_seq;
      state.ended = ended;
    }
    state.utime = WallUs();
    bus->Publish(channels::kStreamState, state);
  }

  void Run() {
    while (!stop) {
      try {
        FillWindow();
        SendDue();
        SendHeartbeat();
        bus->Handle(window.empty() ? 5 : 2);
      } catch (const std::exception& e) {
        spdlog::error("stream sender: {}", e.what());
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
      }
    }
  }
};

StreamSender::StreamSender(Bus* bus, const std::string& session, const StreamSenderOptions& options)
    : impl_(std::make_unique<Impl>(bus, session, options)) {
  bus->Subscribe<ack_t>(channels::kAck, Delivery::kKeepAll,
                        [impl = impl_.get(), alive = std::weak_ptr<char>(impl_->alive)](const ack_t& ack) {
                          if (!alive.expired()) impl->OnAck(ack);
                        });
  impl_->thread = std::thread([impl = impl_.get()] { impl->Run(); });
}

StreamSender::~StreamSender() {
  impl_->stop = true;
  impl_->thread.join();
}

int64_t StreamSender::Append(int64_t utime, RecordBody body) {
  const bool is_end = std::holds_alternative<SessionEnded>(body);
  Record record{{impl_->session, -1, utime}, std::move(body)};
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  record.header.seq = impl_->last_seq + 1;
  impl_->outbox.Append(EncodeRecord(record));
  impl_->ended = impl_->ended || is_end;
  return ++impl_->last_seq;
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
