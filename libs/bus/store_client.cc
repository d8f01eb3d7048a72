#include "libs/bus/store_client.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <mapmend/bow_query_t.hpp>
#include <mapmend/bow_result_t.hpp>
#include <mapmend/close_session_t.hpp>
#include <mapmend/edge_decisions_t.hpp>
#include <mapmend/edge_request_t.hpp>
#include <mapmend/fetch_t.hpp>
#include <mapmend/fetched_t.hpp>
#include <mapmend/revision_ack_t.hpp>
#include <mapmend/revision_fetch_t.hpp>
#include <mapmend/revision_fetched_t.hpp>
#include <mapmend/revision_part_t.hpp>
#include <mapmend/revision_t.hpp>
#include <mapmend/session_closed_t.hpp>
#include <set>

#include "libs/bus/channels.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kRetry = std::chrono::milliseconds(500);       // without an answer
constexpr auto kNotYetRetry = std::chrono::milliseconds(20);  // the store has not committed so far yet
constexpr size_t kRevisionPartsInFlight = 8;

}  // namespace

struct StoreClient::Impl {
  Bus* bus;
  std::string requester;
  int64_t last_id = 0;
  std::optional<bow_result_t> bow_result;
  std::optional<fetched_t> fetched;
  std::optional<revision_fetched_t> revision_fetched;
  std::optional<session_closed_t> session_closed;
  std::optional<edge_decisions_t> edge_decisions;
  std::set<int32_t> unacknowledged;  // parts of the revision that is being stored
  int64_t storing_revision = -1;
  std::shared_ptr<char> alive = std::make_shared<char>();  // the bus may outlive us and still have our handlers

  template <typename Reply>
  void Listen(const char* channel, std::optional<Reply> Impl::*slot) {
    bus->Subscribe<Reply>(channel, Delivery::kKeepAll,
                          [this, slot, weak = std::weak_ptr<char>(alive)](const Reply& reply) {
                            if (weak.expired()) return;
                            if (reply.requester == requester && reply.id == last_id) this->*slot = reply;
                          });
  }

  // Sends the request, again after kRetry, until is_final says that the reply will do. A reply that will not do is
  // asked for again soon.
  template <typename Request, typename Reply, typename IsFinal>
  std::optional<Reply> Ask(const char* channel, Request request, std::optional<Reply> Impl::*slot, int timeout_ms,
                           IsFinal is_final) {
    const auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
    request.requester = requester;
    std::optional<Reply> last;
    do {
      request.id = ++last_id;
      (this->*slot).reset();
      const bool sent = bus->Publish(channel, request);
      const auto resend = std::min(deadline, Clock::now() + (sent ? kRetry : kNotYetRetry));
      while (!(this->*slot) && Clock::now() < resend) bus->Handle(WaitMs(resend));
      if (this->*slot) {
        last = std::move(this->*slot);
        if (is_final(*last)) return last;
        const auto retry = std::min(deadline, Clock::now() + kNotYetRetry);
        while (Clock::now() < retry) bus->Handle(WaitMs(retry));
      }
    } while (Clock::now() < deadline);
    return last;
  }

  static int WaitMs(Clock::time_point until) {
    const auto ms = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
    return static_cast<int>(std::clamp<int64_t>(ms, 0, 100));
  }
};

StoreClient::StoreClient(Bus* bus, const std::string& requester) : impl_(std::make_unique<Impl>()) {
  impl_->bus = bus;
  impl_->requester = requester;
  // Ids of an earlier process with the same name must not match ours.
  impl_->last_id = std::chrono::system_clock::now().time_since_epoch().count();
  impl_->Listen(channels::kBowResult, &Impl::bow_result);
  impl_->Listen(channels::kFetched, &Impl::fetched);
  impl_->Listen(channels::kRevisionFetched, &Impl::revision_fetched);
  impl_->Listen(channels::kSessionClosed, &Impl::session_closed);
  impl_->Listen(channels::kEdgeDecisions, &Impl::edge_decisions);
  bus->Subscribe<revision_ack_t>(
      channels::kRevisionAck, Delivery::kKeepAll,
      [impl = impl_.get(), weak = std::weak_ptr<char>(impl_->alive)](const revision_ack_t& ack) {
        if (weak.expired()) return;
        if (ack.revision == impl->storing_revision) impl->unacknowledged.erase(ack.part);
      });
}

StoreClient::~StoreClient() = default;

std::optional<bow_result_t> StoreClient::Query(bow_query_t query, int timeout_ms) {
  return impl_->Ask(channels::kBowQuery, std::move(query), &Impl::bow_result, timeout_ms,
                    [](const bow_result_t& result) { return result.status != bow_result_t::NOT_YET; });
}

std::optional<fetched_t> StoreClient::Fetch(fetch_t request, int timeout_ms) {
  return impl_->Ask(channels::kFetch, std::move(request), &Impl::fetched, timeout_ms,
                    [](const fetched_t&) { return true; });
}

std::optional<session_closed_t> StoreClient::CloseSession(const std::string& session, int timeout_ms) {
  close_session_t request{};
  request.session = session;
  return impl_->Ask(channels::kCloseSession, request, &Impl::session_closed, timeout_ms,
                    [](const session_closed_t& reply) { return reply.status != session_closed_t::STILL_ALIVE; });
}

std::optional<edge_decisions_t> StoreClient::DecideEdges(const std::vector<edge_decision_t>& decisions,
                                                         int timeout_ms) {
  edge_request_t request{};
  request.decisions = decisions;
  request.num_decisions = static_cast<int32_t>(decisions.size());
  return impl_->Ask(channels::kEdgeRequest, request, &Impl::edge_decisions, timeout_ms,
                    [](const edge_decisions_t&) { return true; });
}

bool StoreClient::StoreRevision(const revision_t& revision, const std::vector<revision_part_t>& parts, int timeout_ms) {
  auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
  impl_->storing_revision = revision.transforms.revision;
  // The message itself first and alone: it replaces what was stored under its number.
  std::vector<int32_t> order = {-1};
  for (const revision_part_t& part : parts) order.push_back(part.part);
  std::map<int32_t, Clock::time_point> sent;
  size_t begin = 0;  // all before it are acknowledged
  impl_->unacknowledged = std::set<int32_t>(order.begin(), order.end());
  const auto publish = [&](size_t i) {
    return i == 0 ? impl_->bus->Publish(channels::kRevision, revision)
                  : impl_->bus->Publish(channels::kRevisionPart, parts[i - 1]);
  };
  while (true) {
    const size_t before = begin;
    while (begin < order.size() && !impl_->unacknowledged.contains(order[begin])) ++begin;
    if (begin == order.size()) return true;
    if (begin > before) deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);  // it makes progress
    if (Clock::now() >= deadline) return false;
    const size_t end = begin == 0 ? 1 : std::min(order.size(), begin + kRevisionPartsInFlight);
    for (size_t i = begin; i < end; ++i) {
      if (!impl_->unacknowledged.contains(order[i])) continue;
      const auto it = sent.find(order[i]);
      if (it != sent.end() && Clock::now() - it->second < kRetry) continue;
      if (publish(i)) sent[order[i]] = Clock::now();
    }
    impl_->bus->Handle(20);
  }
}

StoreClient::RevisionStatus StoreClient::FetchRevision(int64_t number, revision_t* revision,
                                                       std::vector<revision_part_t>* parts, int timeout_ms) {
  const auto ask = [&](int64_t wanted, int32_t part) {
    revision_fetch_t request{};
    request.revision = wanted;
    request.part = part;
    return impl_->Ask(channels::kRevisionFetch, request, &Impl::revision_fetched, timeout_ms,
                      [](const revision_fetched_t&) { return true; });
  };
  auto reply = ask(number, -1);
  if (!reply) return RevisionStatus::kNoAnswer;
  if (reply->status != revision_fetched_t::OK) return RevisionStatus::kNone;
  const int64_t found = reply->revision;
  const int32_t num_parts = reply->num_parts;
  if (!DecodeMessage(reply->data.data(), reply->num_bytes, revision)) return RevisionStatus::kNone;
  parts->clear();
  for (int32_t i = 0; i < num_parts; ++i) {
    reply = ask(found, i);
    if (!reply) return RevisionStatus::kNoAnswer;
    parts->emplace_back();
    if (reply->status != revision_fetched_t::OK || reply->revision != found ||
        !DecodeMessage(reply->data.data(), reply->num_bytes, &parts->back())) {
      return RevisionStatus::kNone;
    }
  }
  return RevisionStatus::kOk;
}

}  // namespace mapmend
