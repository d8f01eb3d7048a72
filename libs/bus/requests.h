#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libs/base/backoff.h"
#include "libs/bus/bus.h"

namespace mapmend {

// Who a reply is for: every reply type begins with id and requester. nullopt if the bytes are too few for them.
struct ReplyAddress {
  int64_t id = 0;
  std::string requester;
};
std::optional<ReplyAddress> PeekReply(const uint8_t* data, int size);

// The requests of one kind that a client has made. A request keeps its id until it is answered, however often it is
// sent and however often the caller gives up waiting: who asks the same again gets an answer that came meanwhile, and
// goes on waiting for the old one otherwise. So a store that is slow is never asked for work that nobody waits for.
//   Request, Reply  types with `id` and `requester`, and with Encode and Decode (bus_impl.h)
template <typename Request, typename Reply>
class Requests {
 public:
  using Clock = std::chrono::steady_clock;

  Requests(Bus* bus, std::string requester, const char* request_channel, const char* reply_channel)
      : bus_(bus), requester_(std::move(requester)), request_channel_(request_channel), reply_channel_(reply_channel) {
    // Ids of an earlier process with the same name must not match ours.
    std::random_device random;
    last_id_ = static_cast<int64_t>(random()) << 30 | static_cast<int64_t>(random() >> 2);
  }

  // Sends the request when it is due and waits up to timeout_ms for its answer. nullopt: none yet.
  std::optional<Reply> Ask(Request request, int timeout_ms) {
    const auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
    ListenForReplies();
    // By its place, not its address: handlers that run meanwhile add nothing, but the queue may grow in later calls.
    Outstanding& outstanding = FindOrAdd(std::move(request));
    for (;;) {
      if (outstanding.reply) {
        Reply reply = std::move(*outstanding.reply);
        const int64_t id = outstanding.request.id;
        std::erase_if(outstanding_, [&](const Outstanding& o) { return o.request.id == id; });
        return reply;
      }
      const auto now = Clock::now();
      SendIfDue(&outstanding, now);
      if (now >= deadline) return std::nullopt;
      const auto wait = std::chrono::ceil<std::chrono::milliseconds>(std::min(deadline, outstanding.due) - now).count();
      bus_->Handle(static_cast<int>(std::clamp<int64_t>(wait, 0, 100)));
    }
  }

 private:
  static constexpr auto kFirstRetry = std::chrono::milliseconds(500), kMostRetry = std::chrono::milliseconds(8000);
  static constexpr auto kNoLinkRetry = std::chrono::milliseconds(20);
  static constexpr size_t kMaxOutstanding = 16;  // older ones nobody asks for any more

  struct Outstanding {
    Request request;
    std::vector<uint8_t> content;  // the request without its id
    std::optional<Reply> reply;
    Clock::time_point due;
    int64_t connection = -1;  // that it was last sent over
    Backoff backoff{kFirstRetry, kMostRetry};
  };

  // From the first question on: replies go to all who listen, and who asks nothing of a kind, say a vehicle on a slow
  // link, is spared the megabytes that others are sent.
  void ListenForReplies() {
    if (is_listening_) return;
    is_listening_ = true;
    subscription_ = bus_->SubscribeRaw(reply_channel_, Delivery::kKeepAll,
                                       [this](const uint8_t* data, int size) { OnReply(data, size); });
  }

  Outstanding& FindOrAdd(Request request) {
    request.requester = requester_;
    request.id = 0;
    std::vector<uint8_t> content = Encode(request);
    for (Outstanding& outstanding : outstanding_) {
      if (outstanding.content == content) return outstanding;
    }
    if (outstanding_.size() >= kMaxOutstanding) outstanding_.pop_front();
    request.id = ++last_id_;
    outstanding_.emplace_back();
    outstanding_.back().request = std::move(request);
    outstanding_.back().content = std::move(content);
    return outstanding_.back();
  }

  // What was sent over a connection that is gone may not have arrived.
  void SendIfDue(Outstanding* outstanding, Clock::time_point now) {
    const int64_t connection = bus_->ConnectionNumber();
    const bool is_lost = outstanding->connection >= 0 && connection != outstanding->connection;
    if (is_lost) outstanding->backoff.Reset();
    if (!is_lost && now < outstanding->due) return;
    if (bus_->Publish(request_channel_, outstanding->request)) {
      outstanding->connection = connection;
      outstanding->due = now + outstanding->backoff.Next();
    } else {
      outstanding->connection = -1;
      outstanding->due = now + kNoLinkRetry;
    }
  }

  void OnReply(const uint8_t* data, int size) {
    const std::optional<ReplyAddress> address = PeekReply(data, size);
    if (!address || address->requester != requester_) return;  // most replies are for others
    for (Outstanding& outstanding : outstanding_) {
      if (outstanding.request.id != address->id) continue;
      Decoded<Reply> reply = Decode<Reply>(data, size);
      if (!reply.value) throw std::runtime_error(reply.error);  // the bus counts it as refused; the question stays open
      outstanding.reply = std::move(*reply.value);
    }
  }

  Bus* bus_;
  const std::string requester_;
  const char* request_channel_;
  const char* reply_channel_;
  bool is_listening_ = false;
  int64_t last_id_ = 0;
  std::deque<Outstanding> outstanding_;
  Subscription subscription_;
};

}  // namespace mapmend
