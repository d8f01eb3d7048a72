#include "procs/submap_store/store_adapter.h"

#include <spdlog/spdlog.h>

#include <chrono>

#include "libs/bus/channels.h"

namespace mapmend {
namespace {

constexpr int64_t kAckIntervalMs = 50;
constexpr int64_t kHealthIntervalMs = 1000;

int64_t SteadyMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

int64_t WallUs() {
  return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

StoreAdapter::StoreAdapter(Bus* bus, SubmapStore* store) : bus_(bus), store_(store), health_(bus, "submap_store") {
  for (const char* channel : kRecordChannels) {
    subscriptions_.push_back(bus->SubscribeRaw(
        channel, Delivery::kKeepAll,
        [this, channel](const uint8_t* data, int size) { store_->OnRecord(channel, data, size, SteadyMs()); }));
  }
  subscriptions_.push_back(bus->Subscribe<stream_state_t>(
      channels::kStreamState, Delivery::kKeepAll,
      [this](const stream_state_t& state) { store_->OnHeartbeat(state, SteadyMs(), WallUs()); }));
  subscriptions_.push_back(bus->Subscribe<bow_query_t>(
      channels::kBowQuery, Delivery::kKeepAll,
      [this](const bow_query_t& query) { bus_->Publish(channels::kBowResult, store_->Query(query)); }));
  subscriptions_.push_back(bus->Subscribe<fetch_t>(
      channels::kFetch, Delivery::kKeepAll,
      [this](const fetch_t& request) { bus_->Publish(channels::kFetched, store_->Fetch(request)); }));
  subscriptions_.push_back(
      bus->Subscribe<edge_request_t>(channels::kEdgeRequest, Delivery::kKeepAll, [this](const edge_request_t& request) {
        bus_->Publish(channels::kEdgeDecisions, store_->edge_decisions()->Decide(request));
      }));
  subscriptions_.push_back(bus->Subscribe<close_session_t>(
      channels::kCloseSession, Delivery::kKeepAll, [this](const close_session_t& request) {
        bus_->Publish(channels::kSessionClosed, store_->Close(request, SteadyMs()));
      }));
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
  subscriptions_.push_back(bus->Subscribe<revision_fetch_t>(
      channels::kRevisionFetch, Delivery::kKeepAll, [this](const revision_fetch_t& request) {
        bus_->Publish(channels::kRevisionFetched, store_->revisions()->Fetch(request));
      }));
}

void StoreAdapter::Spin(int timeout_ms) {
  bus_->Handle(has_background_work_ ? 0 : timeout_ms);
  const int64_t now = SteadyMs();
  for (const std::string& session : store_->CommitReady(now)) bus_->Publish(channels::kAck, store_->Ack(session));
  if (now - last_ack_ms_ >= kAckIntervalMs) {
    last_ack_ms_ = now;
    for (const ack_t& ack : store_->Acks(now)) bus_->Publish(channels::kAck, ack);
  }
  has_background_work_ = store_->WorkInBackground();
  ReportHealth(now);
}

void StoreAdapter::ReportHealth(int64_t now_ms) {
  if (now_ms - last_health_ms_ < kHealthIntervalMs) {
    health_.Tick();
    return;
  }
  const SubmapStore::Status status = store_->GetStatus(now_ms);
  const double seconds = last_health_ms_ == 0 ? 1.0 : 1e-3 * static_cast<double>(now_ms - last_health_ms_);
  last_health_ms_ = now_ms;
  for (const auto& [session, seq] : status.cursors) health_.SetCursor(session, seq);
  health_.SetQueueDepth(status.queue_depth);
  health_.SetCounter("records", static_cast<double>(status.records));
  health_.SetCounter("records_per_s", static_cast<double>(status.records - last_records_) / seconds);
  health_.SetCounter("keyframes", static_cast<double>(status.keyframes));
  health_.SetCounter("duplicates", static_cast<double>(status.duplicates));
  health_.SetCounter("bad_messages", static_cast<double>(status.refused + bus_->NumRefused()));
  health_.SetCounter("gaps", static_cast<double>(status.gaps));
  health_.SetCounter("open_sessions", status.open_sessions);
  health_.SetCounter("silent_sessions", status.silent_sessions);
  health_.SetCounter("index_mb", static_cast<double>(status.bytes_in_memory) / (1 << 20));
  last_records_ = status.records;
  health_.SetState(status.error.empty() ? "ready" : "error", status.error);
  health_.Tick();
}

}  // namespace mapmend
