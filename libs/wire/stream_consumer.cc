#include "libs/wire/stream_consumer.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

#include "libs/bus/channels.h"
#include "libs/wire/codec.h"
#include "libs/wire/stream_codec.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int64_t kMaxLiveBytes = 64 << 20;  // per session; what does not fit is fetched later
constexpr int32_t kFetchBytes = 512 << 10;   // of one reply: small, so that others get theirs in between
constexpr int kStoreTimeoutMs = 400;         // short, so that the caller's heartbeats go on without a store
constexpr auto kListInterval = std::chrono::milliseconds(1000);

}  // namespace

struct StreamConsumer::Impl {
  struct Waiting {
    std::string channel;
    std::vector<uint8_t> data;
    bool is_fetched = false;
  };
  struct SessionState {
    std::string id;
    int64_t delivered = -1;
    int64_t committed = -1;     // known to be in the store
    int64_t acknowledged = -1;  // of that, what an ack told of; acks name the holes, so what was heard live may be used
    bool ended = false;
    std::map<int64_t, Waiting> live;  // heard on the bus, or fetched ahead
    int64_t live_bytes = 0;
    std::optional<FetchRequest> asked;  // without an answer yet; asked anew only as it was
  };

  Bus* bus;
  StoreClient* store;
  Handler handler;
  std::vector<std::unique_ptr<SessionState>> sessions;  // oldest first
  bool listed_once = false;
  Clock::time_point last_list;
  std::optional<std::map<std::string, int64_t>> delivered_when_asked;  // for the list, while it is not answered
  int64_t num_refused = 0;
  std::vector<Subscription> subscriptions;

  SessionState* Find(const std::string& id) {
    for (const auto& session : sessions) {
      if (session->id == id) return session.get();
    }
    return nullptr;
  }

  SessionState* FindOrAdd(const std::string& id) {
    if (SessionState* session = Find(id)) return session;
    sessions.push_back(std::make_unique<SessionState>());
    sessions.back()->id = id;
    return sessions.back().get();
  }

  void Keep(SessionState* session, int64_t seq, const std::string& channel, const uint8_t* data, int64_t size) {
    if (seq <= session->delivered || session->live.contains(seq)) return;
    if (session->live_bytes + size > kMaxLiveBytes) return;
    session->live[seq] = {channel, std::vector<uint8_t>(data, data + size), false};
    session->live_bytes += size;
  }

  // As Keep, but the store's word replaces what was heard.
  void KeepFetched(SessionState* session, const EncodedRecord& record) {
    Waiting& waiting = session->live[record.seq];
    session->live_bytes += static_cast<int64_t>(record.data.size()) - static_cast<int64_t>(waiting.data.size());
    waiting = {record.channel, record.data, true};
  }

  void Forget(SessionState* session, int64_t seq) {
    const auto it = session->live.find(seq);
    if (it == session->live.end() || it->second.is_fetched) return;
    session->live_bytes -= static_cast<int64_t>(it->second.data.size());
    session->live.erase(it);
  }

  void OnRecord(const std::string& channel, const uint8_t* data, int size) {
    const std::optional<RecordHeader> header = PeekHeader(data, size);
    if (!header) {
      ++num_refused;
      return;
    }
    // Unknown sessions come to be known by an ack or by the store's list: anybody can send a record.
    if (SessionState* session = Find(header->session)) Keep(session, header->seq, channel, data, size);
  }

  void OnAck(const StreamAck& ack) {
    if (!listed_once || ack.cumulative < 0 || !IsSessionId(ack.session)) return;
    SessionState* session = FindOrAdd(ack.session);
    session->acknowledged = std::max(session->acknowledged, ack.cumulative);
    session->committed = std::max(session->committed, ack.cumulative);
    // Missing, yet not waited for: the store has given it up or refused it. What it does not have is not delivered.
    for (const int64_t seq : ack.missing) {
      if (seq <= ack.cumulative) Forget(session, seq);
    }
  }

  void ListSessions() {
    const auto now = Clock::now();
    if (listed_once && now - last_list < kListInterval) return;
    last_list = now;
    if (!delivered_when_asked) {
      delivered_when_asked.emplace();
      for (const auto& session : sessions) (*delivered_when_asked)[session->id] = session->delivered;
    }
    const auto reply = store->Fetch(FetchRequest{}, kStoreTimeoutMs);
    if (!reply) return;
    const std::map<std::string, int64_t> delivered = *std::exchange(delivered_when_asked, std::nullopt);
    if (reply->status != FetchAnswer::Status::kOk) return;
    for (const StreamCursor& cursor : reply->sessions) {
      if (!IsSessionId(cursor.session)) continue;
      SessionState* session = FindOrAdd(cursor.session);
      session->committed = std::max(session->committed, cursor.seq);
      // The answer may have waited for us, but it is younger than the question.
      const auto known = delivered.find(cursor.session);
      if (known != delivered.end() && cursor.seq < known->second) RefuseToGoOn(*session);
    }
    listed_once = true;  // until then no acks were heeded, so the order of sessions is the store's
  }

  // It was closed in its frontend's absence, and then its frontend's own records came after all: what we delivered in
  // their place cannot be taken back.
  [[noreturn]] static void RefuseToGoOn(const SessionState& session) {
    throw std::runtime_error("session " + session.id +
                             " has been taken up again by the store: what was known of it does not hold any more");
  }

  void SkipTo(SessionState* session, int64_t delivered) {
    session->delivered = delivered;
    while (!session->live.empty() && session->live.begin()->first <= delivered) {
      session->live_bytes -= static_cast<int64_t>(session->live.begin()->second.data.size());
      session->live.erase(session->live.begin());
    }
  }

  // Gets the record after `delivered`; false if it cannot be had now.
  bool Obtain(SessionState* session) {
    if (!session->asked) {
      session->asked = FetchRequest{Addressed(), session->id, session->delivered + 1, session->committed, kFetchBytes};
    }
    const auto reply = store->Fetch(*session->asked, kStoreTimeoutMs);
    if (!reply) return false;
    const int64_t asked_to = std::exchange(session->asked, std::nullopt)->last_seq;
    if (reply->status != FetchAnswer::Status::kOk || reply->session != session->id) return false;
    if (session->ended && (!reply->ended || !reply->records.empty())) RefuseToGoOn(*session);
    if (!reply->records.empty() && reply->records.front().seq > session->delivered + 1) {
      // The store has no records in between: a hole that it has given up (its gap table).
      const int64_t last_lost = reply->records.front().seq - 1;
      spdlog::warn("session {}: records {} to {} are lost", session->id, session->delivered + 1, last_lost);
      SkipTo(session, last_lost);
    }
    for (const EncodedRecord& record : reply->records) {
      if (record.seq > session->delivered) KeepFetched(session, record);
    }
    if (reply->records.empty() && reply->cumulative >= asked_to && asked_to > session->delivered) {
      SkipTo(session, asked_to);  // a hole at the end
    }
    return !reply->records.empty();
  }

  int Deliver(SessionState* session, int max_records) {
    int num_delivered = 0;
    while (num_delivered < max_records && session->delivered < session->committed) {
      auto it = session->live.find(session->delivered + 1);
      // After its end there is nothing, so far as we know: only the store itself is believed.
      const bool is_usable =
          it != session->live.end() && !session->ended && (it->second.is_fetched || it->first <= session->acknowledged);
      if (!is_usable) {
        if (!Obtain(session)) break;
        it = session->live.find(session->delivered + 1);
        if (it == session->live.end()) break;
      }
      const Waiting waiting = std::move(it->second);
      session->live.erase(it);
      session->live_bytes -= static_cast<int64_t>(waiting.data.size());
      ++session->delivered;
      const DecodedRecord decoded =
          DecodeRecord(waiting.channel, waiting.data.data(), static_cast<int>(waiting.data.size()));
      if (!decoded.record || decoded.record->header.session != session->id ||
          decoded.record->header.seq != session->delivered) {
        ++num_refused;
        spdlog::warn("session {}, record {}: {}", session->id, session->delivered,
                     decoded.record ? "names another record" : decoded.error);
        continue;
      }
      if (std::holds_alternative<SessionEnded>(decoded.record->body)) {
        session->ended = true;
        session->asked.reset();  // an answer to what was asked before says nothing about what comes after
      }
      handler(*decoded.record);
      ++num_delivered;
    }
    return num_delivered;
  }
};

StreamConsumer::StreamConsumer(Bus* bus, StoreClient* store, Handler handler) : impl_(std::make_unique<Impl>()) {
  impl_->bus = bus;
  impl_->store = store;
  impl_->handler = std::move(handler);
  for (const char* channel : kRecordChannels) {
    impl_->subscriptions.push_back(bus->SubscribeRaw(
        channel, Delivery::kKeepAll,
        [impl = impl_.get(), channel](const uint8_t* data, int size) { impl->OnRecord(channel, data, size); }));
  }
  impl_->subscriptions.push_back(bus->Subscribe<StreamAck>(
      channels::kAck, Delivery::kKeepAll, [impl = impl_.get()](const StreamAck& ack) { impl->OnAck(ack); }));
}

StreamConsumer::~StreamConsumer() = default;

int StreamConsumer::Spin(int timeout_ms, int max_records) {
  const auto is_due = [&] {
    return std::any_of(impl_->sessions.begin(), impl_->sessions.end(),
                       [](const auto& session) { return session->delivered < session->committed; });
  };
  impl_->bus->Handle(is_due() ? 0 : timeout_ms);
  impl_->ListSessions();
  if (!impl_->listed_once) return 0;
  int num_delivered = 0;
  for (size_t i = 0; i < impl_->sessions.size() && num_delivered < max_records; ++i) {
    num_delivered += impl_->Deliver(impl_->sessions[i].get(), max_records - num_delivered);
  }
  return num_delivered;
}

std::vector<StreamConsumer::Cursor> StreamConsumer::Cursors() const {
  std::vector<Cursor> cursors;
  for (const auto& session : impl_->sessions) cursors.push_back({session->id, session->delivered, session->ended});
  return cursors;
}

int StreamConsumer::QueueDepth() const {
  int64_t depth = 0;
  for (const auto& session : impl_->sessions) depth += session->committed - session->delivered;
  return static_cast<int>(depth);
}

int64_t StreamConsumer::NumRefused() const { return impl_->num_refused; }

}  // namespace mapmend
