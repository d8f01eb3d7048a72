#include "procs/submap_store/store_adapter.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <random>

#include "libs/bus/channels.h"
#include "libs/wire/query_codec.h"
#include "libs/wire/stream_codec.h"
#include "procs/submap_store/image_store.h"

namespace mapmend {
namespace {

constexpr int64_t kAckIntervalMs = 50;
constexpr int64_t kHealthIntervalMs = 1000;
constexpr int64_t kMaxReplyBytesAtOnce = 1 << 20;  // then records have their turn again

int64_t SteadyMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

StoreAdapter::StoreAdapter(Bus* bus, SubmapStore* store, const ImageStore* images)
    : bus_(bus), store_(store), images_(images), health_(bus, "submap_store"), incarnation_(std::random_device{}()) {
  TellIncarnation();
  for (const char* channel : kRecordChannels) {
    subscriptions_.push_back(
        bus->SubscribeRaw(channel, Delivery::kKeepAll, [this, channel](const uint8_t* data, int size) {
          if (!store_->MustReload()) store_->OnRecord(channel, data, size, SteadyMs());
        }));
  }
  subscriptions_.push_back(
      bus->Subscribe<StreamState>(channels::kStreamState, Delivery::kKeepAll, [this](const StreamState& state) {
        if (!store_->MustReload()) store_->OnHeartbeat(state, SteadyMs());
      }));
  Serve<BowQuery, BowAnswer>(channels::kBowQuery, channels::kBowResult,
                             [this](const BowQuery& query) { return store_->Query(query); });
  Serve<FetchRequest, FetchAnswer>(channels::kFetch, channels::kFetched,
                                   [this](const FetchRequest& request) { return store_->Fetch(request); });
  Serve<ProgressRequest, SessionProgress>(channels::kProgressRequest, channels::kProgress,
                                          [this](const ProgressRequest& request) { return store_->Progress(request); });
  Serve<EdgeRequest, EdgeAnswer>(channels::kEdgeRequest, channels::kEdgeDecisions, [this](const EdgeRequest& request) {
    return store_->edge_decisions()->Decide(request);
  });
  Serve<CloseRequest, CloseAnswer>(channels::kCloseSession, channels::kSessionClosed,
                                   [this](const CloseRequest& request) { return store_->Close(request, SteadyMs()); });
  Serve<RevisionRequest, RevisionAnswer>(
      channels::kRevisionFetch, channels::kRevisionFetched,
      [this](const RevisionRequest& request) { return store_->revisions()->Fetch(request); });
  subscriptions_.push_back(
      bus->SubscribeRaw(channels::kRevision, Delivery::kKeepAll, [this](const uint8_t* data, int size) {
        if (const auto ack = store_->revisions()->Store(data, size)) {
          bus_->Publish(channels::kRevisionAck, *ack);
        } else {
          throw std::runtime_error("not a valid revision_t");
        }
      }));
  subscriptions_.push_back(
      bus->SubscribeRaw(channels::kRevisionPart, Delivery::kKeepAll, [this](const uint8_t* data, int size) {
        if (const auto ack = store_->revisions()->StorePart(data, size)) {
          bus_->Publish(channels::kRevisionAck, *ack);
        } else {
          throw std::runtime_error("not a valid revision_part_t");
        }
      }));
}

// Requests wait until what came before them is committed. One that is repeated while it waits, or whose answer has just
// been sent, is dropped: it would only make the others wait.
template <typename Request, typename Reply>
void StoreAdapter::Serve(const char* request_channel, const char* reply_channel,
                         std::function<Reply(const Request&)> answer) {
  subscriptions_.push_back(bus_->Subscribe<Request>(
      request_channel, Delivery::kKeepAll, [this, request_channel, reply_channel, answer](const Request& request) {
        requests_.Add({request_channel, request.requester, request.id}, SteadyMs(),
                      [this, request_channel, reply_channel, answer, request] {
                        try {
                          const std::vector<uint8_t> reply = Encode(answer(request));
                          bus_->PublishRaw(reply_channel, reply.data(), static_cast<int>(reply.size()));
                          return static_cast<int64_t>(reply.size());
                        } catch (const std::exception& e) {  // e.g. a full disk; it is asked for again
                          spdlog::warn("{}: no answer: {}", request_channel, e.what());
                          return int64_t{0};
                        }
                      });
      }));
}

void StoreAdapter::Spin(int timeout_ms) {
  bus_->Handle(has_background_work_ || !requests_.Empty() ? 0 : timeout_ms);
  if (store_->MustReload()) return;
  const int64_t now = SteadyMs();
  for (const std::string& session : store_->CommitReady(now)) bus_->Publish(channels::kAck, store_->Ack(session));
  if (now - last_ack_ms_ >= kAckIntervalMs) {
    last_ack_ms_ = now;
    for (const StreamAck& ack : store_->Acks(now)) bus_->Publish(channels::kAck, ack);
  }
  requests_.Answer(now, kMaxReplyBytesAtOnce);
  has_background_work_ = store_->WorkInBackground();
  ReportHealth(now);
}

void StoreAdapter::TellIncarnation() { bus_->Publish(channels::kStoreStarted, StoreStarted{incarnation_}); }

void StoreAdapter::ReportHealth(int64_t now_ms) {
  if (now_ms - last_health_ms_ < kHealthIntervalMs) {
    health_.Tick();
    return;
  }
  store_->CheckPlace();
  const SubmapStore::Status status = store_->GetStatus(now_ms);
  const double seconds = last_health_ms_ == 0 ? 1.0 : 1e-3 * static_cast<double>(now_ms - last_health_ms_);
  last_health_ms_ = now_ms;
  TellIncarnation();
  for (const auto& [session, seq] : status.cursors) health_.SetCursor(session, seq);
  health_.SetQueueDepth(status.queue_depth);
  health_.SetCounter("records", static_cast<double>(status.records));
  health_.SetCounter("records_per_s", static_cast<double>(status.records - last_records_) / seconds);
  health_.SetCounter("keyframes", static_cast<double>(status.keyframes));
  health_.SetCounter("duplicates", static_cast<double>(status.duplicates));
  health_.SetCounter("bad_messages", static_cast<double>(status.refused + bus_->NumRefused()));
  health_.SetCounter("gaps", static_cast<double>(status.gaps));
  health_.SetCounter("requests_shed", static_cast<double>(requests_.NumShed()));
  health_.SetCounter("open_sessions", status.open_sessions);
  health_.SetCounter("silent_sessions", status.silent_sessions);
  health_.SetCounter("index_mb", static_cast<double>(status.bytes_in_memory) / (1 << 20));
  if (images_ != nullptr) {
    const ImageStore::Counts images = images_->GetCounts();
    health_.SetCounter("images_stored", images.stored);
    health_.SetCounter("images_awaited", images.awaited);
    health_.SetCounter("images_lost", images.lost);
  }
  last_records_ = status.records;
  health_.SetState(status.error.empty() ? "ready" : "error", status.error);
  health_.Tick();
}

}  // namespace mapmend
