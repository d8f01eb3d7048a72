#include "libs/wire/store_client.h"

#include <algorithm>
#include <chrono>
#include <set>
#include <utility>

#include "libs/base/backoff.h"
#include "libs/bus/channels.h"
#include "libs/bus/requests.h"
#include "libs/wire/image_codec.h"
#include "libs/wire/query_codec.h"
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
  Requests<BowQuery, BowAnswer> queries;
  Requests<FetchRequest, FetchAnswer> fetches;
  Requests<RevisionRequest, RevisionAnswer> revision_fetches;
  Requests<CloseRequest, CloseAnswer> closings;
  Requests<ProgressRequest, SessionProgress> progress_requests;
  Requests<EdgeRequest, EdgeAnswer> edge_requests;
  Requests<ImageFetch, ImageAnswer> image_fetches;
  Requests<ImageStatusRequest, ImageStatus> image_status_requests;
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
        edge_requests(b, requester, channels::kEdgeRequest, channels::kEdgeDecisions),
        image_fetches(b, requester, channels::kImageFetch, channels::kImageFetched),
        image_status_requests(b, requester, channels::kImageStatusRequest, channels::kImageStatus) {
    revision_acks =
        bus->Subscribe<RevisionAck>(channels::kRevisionAck, Delivery::kKeepAll, [this](const RevisionAck& ack) {
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

std::optional<BowAnswer> StoreClient::Query(const BowQuestion& question, int timeout_ms) {
  return impl_->AskUntil(&impl_->queries, BowQuery{Addressed(), question}, timeout_ms,
                         [](const BowAnswer& answer) { return answer.status != BowAnswer::Status::kNotYet; });
}

std::optional<FetchAnswer> StoreClient::Fetch(FetchRequest request, int timeout_ms) {
  return impl_->fetches.Ask(std::move(request), timeout_ms);
}

std::optional<SessionProgress> StoreClient::AskProgress(const std::string& session, int timeout_ms) {
  return impl_->progress_requests.Ask(ProgressRequest{Addressed(), session}, timeout_ms);
}

std::optional<CloseAnswer> StoreClient::CloseSession(const std::string& session, int timeout_ms) {
  return impl_->AskUntil(&impl_->closings, CloseRequest{Addressed(), session}, timeout_ms,
                         [](const CloseAnswer& answer) { return answer.status != CloseAnswer::Status::kStillAlive; });
}

std::optional<std::vector<EdgeDecision>> StoreClient::DecideEdges(const std::vector<EdgeDecision>& decisions,
                                                                  int timeout_ms) {
  std::optional<EdgeAnswer> answer = impl_->edge_requests.Ask(EdgeRequest{Addressed(), decisions}, timeout_ms);
  if (!answer) return std::nullopt;
  return std::move(answer->decisions);
}

std::optional<ImageAnswer> StoreClient::FetchImage(const std::string& session, KeyframeId keyframe, int timeout_ms) {
  return impl_->image_fetches.Ask(ImageFetch{Addressed(), session, keyframe}, timeout_ms);
}

std::optional<ImageStatus> StoreClient::AskImages(const std::string& session, int timeout_ms) {
  return impl_->image_status_requests.Ask(ImageStatusRequest{Addressed(), session}, timeout_ms);
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
    return impl_->revision_fetches.Ask(RevisionRequest{Addressed(), wanted, part}, timeout_ms);
  };
  auto reply = ask(number, -1);
  if (!reply) return result;
  result.status = RevisionStatus::kNone;
  if (reply->status != RevisionAnswer::Status::kOk) return result;
  const int64_t found = result.number = reply->revision;
  Decoded<RevisionHead> head = Decode<RevisionHead>(reply->data);
  result.error = head.error;
  if (!head.value) return result;
  MapRevision revision{std::move(head.value->transforms), std::move(head.value->connections), {}};
  for (int i = 0; i < head.value->num_parts; ++i) {
    reply = ask(found, i);
    if (!reply) return {RevisionStatus::kNoAnswer, found, {}, ""};
    if (reply->status != RevisionAnswer::Status::kOk || reply->revision != found) return result;
    Decoded<RevisionPart> part = Decode<RevisionPart>(reply->data);
    result.error = part.error;
    if (part.value && part.value->revision != revision.transforms.revision)
      result.error = "a part is of another revision";
    if (!result.error.empty()) return result;
    revision.refined.push_back(std::move(part.value->submap));
  }
  return {RevisionStatus::kOk, found, std::move(revision), ""};
}

}  // namespace mapmend
