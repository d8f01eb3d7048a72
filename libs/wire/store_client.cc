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
#include <mapmend/revision_part_t.hpp>
#include <mapmend/revision_t.hpp>
#include <mapmend/session_closed_t.hpp>
#include <set>
#include <utility>

#include "libs/base/backoff.h"
#include "libs/bus/channels.h"
#include "libs/bus/requests.h"

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

std::optional<edge_decisions_t> StoreClient::DecideEdges(const std::vector<edge_decision_t>& decisions,
                                                         int timeout_ms) {
  edge_request_t request{};
  request.decisions = decisions;
  request.num_decisions = static_cast<int32_t>(decisions.size());
  return impl_->edge_requests.Ask(std::move(request), timeout_ms);
}

bool StoreClient::StoreRevision(const revision_t& revision, const std::vector<revision_part_t>& parts, int timeout_ms) {
  auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
  impl_->storing_revision = revision.transforms.revision;
  // The message itself first and alone: it replaces what was stored under its number.
  struct Piece {
    int32_t number;
    Clock::time_point due;
    Backoff backoff{kFirstRetry, kMostRetry};
  };
  std::vector<Piece> pieces = {{-1, {}}};
  for (const revision_part_t& part : parts) pieces.push_back({part.part, {}});
  impl_->unacknowledged.clear();
  for (const Piece& piece : pieces) impl_->unacknowledged.insert(piece.number);
  const auto publish = [&](size_t i) {
    return i == 0 ? impl_->bus->Publish(channels::kRevision, revision)
                  : impl_->bus->Publish(channels::kRevisionPart, parts[i - 1]);
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

StoreClient::RevisionStatus StoreClient::FetchRevision(int64_t number, revision_t* revision,
                                                       std::vector<revision_part_t>* parts, int timeout_ms) {
  const auto ask = [&](int64_t wanted, int32_t part) {
    revision_fetch_t request{};
    request.revision = wanted;
    request.part = part;
    return impl_->revision_fetches.Ask(std::move(request), timeout_ms);
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
