#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <mapmend/ack_t.hpp>
#include <mapmend/close_session_t.hpp>
#include <mapmend/edge_decisions_t.hpp>
#include <mapmend/edge_request_t.hpp>
#include <mapmend/fetch_t.hpp>
#include <mapmend/fetched_t.hpp>
#include <mapmend/progress_request_t.hpp>
#include <mapmend/progress_t.hpp>
#include <mapmend/session_closed_t.hpp>
#include <mapmend/stream_state_t.hpp>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/wire/codec.h"

namespace mapmend {

// What the submap store says on the bus, without a database, from a thread of its own: so that the other end can be
// tried against losses and silences at will. Thread-safe.
class FakeStore {
 public:
  explicit FakeStore(const std::string& url) : bus_(url, "") {
    for (const char* channel : kRecordChannels) {
      Keep(bus_.SubscribeRaw(channel, Delivery::kKeepAll,
                             [this, channel](const uint8_t* data, int size) { OnRecord(channel, data, size); }));
    }
    Keep(bus_.Subscribe<stream_state_t>(channels::kStreamState, Delivery::kKeepAll,
                                        [this](const stream_state_t& state) { OnState(state); }));
    Keep(bus_.Subscribe<fetch_t>(channels::kFetch, Delivery::kKeepAll, [this](const fetch_t& f) { OnFetch(f); }));
    SubscribeRequests();
    thread_ = std::thread([this] {
      while (!stop_) Spin();
    });
  }
  ~FakeStore() {
    stop_ = true;
    thread_.join();
  }

  std::atomic<bool> is_silent{false};  // hears, but says nothing
  std::atomic<int> still_alive{0};     // so many requests to end a session are answered with "still alive"
  std::atomic<int> num_lost{0};        // records that were lost because of Lose

  // The record is lost the first time it comes.
  void Lose(int64_t seq) {
    const std::lock_guard<std::mutex> lock(mutex_);
    lose_.insert(seq);
  }
  void SetError(const std::string& error) {
    const std::lock_guard<std::mutex> lock(mutex_);
    error_ = error;
  }
  void Put(const EncodedRecord& record) {
    const std::lock_guard<std::mutex> lock(mutex_);
    records_[record.session][record.seq] = record;
  }
  // A hole that the store has given up.
  void GiveUp(const std::string& session, int64_t seq) {
    const std::lock_guard<std::mutex> lock(mutex_);
    given_up_.insert({session, seq});
  }
  void Erase(const std::string& session, int64_t from_seq) {
    const std::lock_guard<std::mutex> lock(mutex_);
    auto& records = records_[session];
    records.erase(records.lower_bound(from_seq), records.end());
  }
  std::map<int64_t, EncodedRecord> Records(const std::string& session) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = records_.find(session);
    return found == records_.end() ? std::map<int64_t, EncodedRecord>() : found->second;
  }

 private:
  void Keep(Subscription subscription) { subscriptions_.push_back(std::move(subscription)); }

  void Spin() {
    bus_.Handle(5);
    if (is_silent) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& [session, records] : records_) {
      ack_t ack{};
      ack.session = session;
      ack.cumulative = Cumulative(session);
      ack.error = error_;
      for (int64_t seq = ack.cumulative + 1; seq <= newest_[session] && ack.missing.size() < 100; ++seq) {
        if (!records.contains(seq)) ack.missing.push_back(seq);
      }
      ack.num_missing = static_cast<int32_t>(ack.missing.size());
      bus_.Publish(channels::kAck, ack);
    }
  }

  int64_t Cumulative(const std::string& session) {
    int64_t seq = -1;
    while (records_[session].contains(seq + 1) || given_up_.contains({session, seq + 1})) ++seq;
    return seq;
  }

  void OnRecord(const std::string& channel, const uint8_t* data, int size) {
    const auto header = PeekHeader(data, size);
    if (!header) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (lose_.erase(header->seq) > 0) {
      ++num_lost;
      return;
    }
    records_[header->session][header->seq] = {header->session, header->seq, channel,
                                              std::vector<uint8_t>(data, data + size)};
  }

  void OnState(const stream_state_t& state) {
    const std::lock_guard<std::mutex> lock(mutex_);
    newest_[state.session] = state.last;
    records_[state.session];  // known from now on
  }

  template <typename Reply, typename Request>
  static Reply ReplyTo(const Request& request) {
    Reply reply{};
    reply.id = request.id;
    reply.requester = request.requester;
    return reply;
  }

  void OnFetch(const fetch_t& request) {
    if (is_silent) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    auto reply = ReplyTo<fetched_t>(request);
    reply.session = request.session;
    if (request.session.empty()) {
      for (const auto& [session, records] : records_) {
        cursor_t cursor{};
        cursor.session = session;
        cursor.seq = Cumulative(session);
        reply.sessions.push_back(cursor);
      }
      reply.num_sessions = static_cast<int32_t>(reply.sessions.size());
    } else {
      reply.cumulative = Cumulative(request.session);
      for (const auto& [seq, record] : records_[request.session]) {
        if (seq < request.first_seq || seq > std::min(request.last_seq, reply.cumulative)) continue;
        if (reply.num_bytes > 0 && reply.num_bytes + static_cast<int64_t>(record.data.size()) > request.max_bytes)
          break;
        reply.seq.push_back(seq);
        reply.channel.push_back(record.channel);
        reply.size.push_back(static_cast<int32_t>(record.data.size()));
        reply.data.insert(reply.data.end(), record.data.begin(), record.data.end());
        reply.num_bytes = static_cast<int32_t>(reply.data.size());
      }
      reply.num_records = static_cast<int32_t>(reply.seq.size());
    }
    bus_.Publish(channels::kFetched, reply);
  }

  bool SayStillAlive() { return still_alive > 0 && still_alive-- > 0; }

  void SubscribeRequests() {
    Keep(bus_.Subscribe<progress_request_t>(channels::kProgressRequest, Delivery::kKeepAll,
                                            [this](const progress_request_t& request) {
                                              auto reply = ReplyTo<progress_t>(request);
                                              reply.session = request.session;
                                              reply.next_submap = 3;
                                              if (!is_silent) bus_.Publish(channels::kProgress, reply);
                                            }));
    Keep(bus_.Subscribe<close_session_t>(channels::kCloseSession, Delivery::kKeepAll,
                                         [this](const close_session_t& request) {
                                           auto reply = ReplyTo<session_closed_t>(request);
                                           reply.session = request.session;
                                           if (SayStillAlive()) reply.status = session_closed_t::STILL_ALIVE;
                                           if (!is_silent) bus_.Publish(channels::kSessionClosed, reply);
                                         }));
    Keep(bus_.Subscribe<edge_request_t>(
        channels::kEdgeRequest, Delivery::kKeepAll, [this](const edge_request_t& request) {
          auto reply = ReplyTo<edge_decisions_t>(request);
          decisions_.insert(decisions_.end(), request.decisions.begin(), request.decisions.end());
          reply.decisions = decisions_;
          reply.num_decisions = static_cast<int32_t>(decisions_.size());
          if (!is_silent) bus_.Publish(channels::kEdgeDecisions, reply);
        }));
  }

  mutable std::mutex mutex_;
  std::map<std::string, std::map<int64_t, EncodedRecord>> records_;
  std::map<std::string, int64_t> newest_;
  std::set<std::pair<std::string, int64_t>> given_up_;
  std::set<int64_t> lose_;
  std::string error_;

  // Of the thread.
  std::vector<edge_decision_t> decisions_;
  Bus bus_;
  std::vector<Subscription> subscriptions_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace mapmend
