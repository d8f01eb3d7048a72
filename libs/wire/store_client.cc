#include "libs/wire/store_client.h"

#include <algorithm>
#include <chrono>
#include <mapmend/bow_query_t.hpp>
#include <mapmend/bow_result_t.hpp>
#include <mapmend/close_session_t.hpp>
#include <mapmend/edge_decisions_t.hpp>
#include <mapmend/edge_request_t.hpp>
#include <mapmend/fetch_t.hpp>
#include <mapmend/fetched_t.hpp>
#include <mapmend/progress_request_t.hpp>
#include <mapmend/progress_t.hpp>
#include <mapmend/revision_ack_t.hpp>
#include <mapmend/revision_fetch_t.hpp>
#include <mapmend/revision_fetched_t.hpp>
#include <mapmend/session_closed_t.hpp>
#include <set>
#include <utility>

#include "libs/base/backoff.h"
#include "libs/bus/channels.h"
#include "libs/bus/requests.h"
#include "libs/wire/revision_codec.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kRevisionPartsInFlight = 8;
// While the store says "not yet": it hears of new records all the time.
constexpr auto kFirstNotYet = std::chrono::milliseconds(20), kMostNotYet = std::chrono::milliseconds(500);
constexpr auto kFirstRetry = std::chrono::milliseconds(500), kMostRetry = std::chrono::milliseconds(8000);

int RemainingMs(Clock::time_point deadline) {
  const auto ms = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return static_cast<int>(std::max<int64_t>(ms, 0));
}

}  // namespace

struct StoreClient::Impl {
  Bus* bus;
  Requests<bow_query_t, bow_result_t> queries;
  Requests<fetch_t, fetched_t> fetches;
  Requests<revision_fetch_t, revision_fetched_t> revision_fetches;
  Requests<close_session_t, session_closed_t> closings;
  Requests<progress_request_t, progress_t> progress_requests;
  Requests<edge_request_t, edge_decisions_t> edge_requests;
  std::set<int32_t> unacknowledged;  // parts of the revision that is being stored
  int64_t storing_revision = -1;
  Subscription revision_acks;

  Impl(Bus* b, const std::string& requester)
      : bus(b),
        queries(b, requester, channels::kBowQuery, channels::kBowResult),
        fetches(b, requester, channels::kFetch, channels::kFetched),
        revision_fetches(b, requester, channels::kRevisionFetch, channels::kRevisionFetched),
        closings(b, requester, channels::kCloseSession, channels::kSessionClosed),
        progress_requests(b, requester, channels::kProgressRequest, channels::kProgress),
        edge_requests(b, requester, channels::kEdgeRequest, channels::kEdgeDecisions) {
    revision_acks =
        bus->Subscribe<revision_ack_t>(channels::kRevisionAck, Delivery::kKeepAll, [this](const revision_ack_t& ack) {
          if (ack.revision == storing_revision) unacknowledged.erase(ack.part);
        });
  }

  // Asks until is_final says that the answer will do, or the time is over: then the last answer, if there was one.
  template <typename Request, typename Reply, typename IsFinal>
  std::optional<Reply> AskUntil(Requests<Request, Reply>* requests, const Request& request, int timeout_ms,
                                IsFinal is_final) {
    const auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
    Backoff backoff(kFirstNotYet, kMostNotYet);
    for (;;) {
      std::optional<Reply> reply = requests->Ask(request, RemainingMs(deadline));
      if (!reply || is_final(*reply)) return reply;
      const auto retry = std::min(deadline, Clock::now() + backoff.Next());
      while (Clock::now() < retry) bus->Handle(RemainingMs(retry));
      if (Clock::now() >= deadline) return reply;
    }
  }
};

StoreClient::StoreClient(Bus* bus, const std::string& requester) : impl_(std::make_unique<Impl>(bus, requester)) {}

StoreClient::~StoreClient() = default;

std::optional<bow_result_t> StoreClient::Query(bow_query_t query, int timeout_ms) {
  return impl_->AskUntil(&impl_->queries, query, timeout_ms,
                         [](const bow_result_t& result) { return result.status != bow_result_t::NOT_YET; });
}

std::optional<fetched_t> StoreClient::Fetch(fetch_t request, int timeout_ms) {
  return impl_->fetches.Ask(std::move(request), timeout_ms);
}

std::optional<progress_t> StoreClient::AskProgress(const std::string& session, int timeout_ms) {
  progress_request_t request{};
  request.session = session;
  return impl_->progress_requests.Ask(std::move(request), timeout_ms);
}

std::optional<session_closed_t> StoreClient::CloseSession(const std::string& session, int timeout_ms) {
  close_session_t request{};
  request.session = session;
  return impl_->AskUntil(&impl_->closings, request, timeout_ms,
                         [](const session_closed_t& reply) { return reply.status != session_closed_t::STILL_ALIVE; });
}

std::optional<std::vector<EdgeDecision>> StoreClient::DecideEdges(const std::vector<EdgeDecision>& decisions,
                                                                  int timeout_ms) {
  edge_request_t request{};
  for (const EdgeDecision& d : decisions) {
    edge_decision_t message{};
    message.session_a = d.a.session;
    message.submap_a = d.a.submap.value;
    message.session_b = d.b.session;
    message.submap_b = d.b.submap.value;
    message.disabled = d.disabled ? 1 : 0;
    request.decisions.push_back(message);
  }
  request.num_decisions = static_cast<int32_t>(decisions.size());
  const auto reply = impl_->edge_requests.Ask(std::move(request), timeout_ms);
  if (!reply) return std::nullopt;
  std::vector<EdgeDecision> all;
  for (const edge_decision_t& d : reply->decisions)
    all.push_back({{d.session_a, SubmapId(d.submap_a)}, {d.session_b, SubmapId(d.submap_b)}, d.disabled != 0});
  return all;
}

bool StoreClient::StoreRevision(const MapRevision& revision, int timeout_ms) {
  auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
  impl_->storing_revision = revision.transforms.revision;
  // The head first and alone: it replaces what was stored under its number.
  struct Piece {
    int32_t number;
    Clock::time_point due;
    Backoff backoff{kFirstRetry, kMostRetry};
  };
  std::vector<Piece> pieces = {{-1, {}}};
  const int num_parts = static_cast<int>(revision.refined.size());
  for (int i = 0; i < num_parts; ++i) pieces.push_back({i, {}});
  impl_->unacknowledged.clear();
  for (const Piece& piece : pieces) impl_->unacknowledged.insert(piece.number);
  const RevisionHead head{revision.transforms, revision.connections, num_parts};
  const auto publish = [&](size_t i) {
    if (i == 0) return impl_->bus->Publish(channels::kRevision, head);
    const RevisionPart part{head.transforms.revision, pieces[i].number, revision.refined[i - 1]};
    return impl_->bus->Publish(channels::kRevisionPart, part);
  };
  size_t begin = 0;  // all before it are acknowledged
  int64_t connection = impl_->bus->ConnectionNumber();
  while (true) {
    const size_t before = begin;
    while (begin < pieces.size() && !impl_->unacknowledged.contains(pieces[begin].number)) ++begin;
    if (begin == pieces.size()) return true;
    if (begin > before) deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);  // it makes progress
    if (Clock::now() >= deadline) return false;
    const bool is_new_connection = std::exchange(connection, impl_->bus->ConnectionNumber()) != connection;
    const size_t end = begin == 0 ? 1 : std::min(pieces.size(), begin + kRevisionPartsInFlight);
    for (size_t i = begin; i < end; ++i) {
      Piece& piece = pieces[i];
      if (!impl_->unacknowledged.contains(piece.number)) continue;
      if (is_new_connection) {
        piece.due = {};
        piece.backoff.Reset();
      }
      if (Clock::now() < piece.due || !publish(i)) continue;
      piece.due = Clock::now() + piece.backoff.Next();
    }
    impl_->bus->Handle(20);
  }
}

StoreClient::FetchedRevision StoreClient::FetchRevision(int64_t number, int timeout_ms) {
  FetchedRevision result;
  const auto ask = [&](int64_t wanted, int32_t part) {
    revision_fetch_t request{};
    request.revision = wanted;
    request.part = part;
    return impl_->revision_fetches.Ask(std::move(request), timeout_ms);
  };
  auto reply = ask(number, -1);
  if (!reply) return result;
  result.status = RevisionStatus::kNone;
  if (reply->status != revision_fetched_t::OK) return result;
  const int64_t found = result.number = reply->revision;
  Decoded<RevisionHead> head = Decode<RevisionHead>(reply->data);
  result.error = head.error;
  if (!head.value) return result;
  MapRevision revision{std::move(head.value->transforms), std::move(head.value->connections), {}};
  for (int i = 0; i < head.value->num_parts; ++i) {
    reply = ask(found, i);
    if (!reply) return {RevisionStatus::kNoAnswer, found, {}, ""};
    if (reply->status != revision_fetched_t::OK || reply->revision != found) return result;
    Decoded<RevisionPart> part = Decode<RevisionPart>(reply->data);
    result.error = part.error;
    if (part.value && part.value->revision != revision.transforms.revision) result.error = "a part is of another revision";
    if (!result.error.empty()) return result;
    revision.refined.push_back(std::move(part.value->submap));
  }
  return {RevisionStatus::kOk, found, std::move(revision), ""};
}

}  // namespace mapmend
