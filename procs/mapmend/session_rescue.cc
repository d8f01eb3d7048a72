#include "procs/mapmend/session_rescue.h"

#include <unistd.h>

#include <chrono>
#include <filesystem>

#include "libs/bus/store_client.h"
#include "libs/bus/stream_sender.h"
#include "mapmend/session_closed_t.hpp"

namespace mapmend {

std::optional<int64_t> RescueSession(Backend* backend, const std::string& session, const std::string& outbox_path) {
  constexpr int kDeliverTimeoutMs = 5000, kCloseTimeoutMs = 2000, kAliveTimeoutMs = 15000;
  if (std::filesystem::exists(outbox_path)) DeliverOutbox(backend->bus(), outbox_path, kDeliverTimeoutMs);
  StoreClient client(backend->bus(), "launcher-" + std::to_string(getpid()));
  // The store takes a frontend for alive until its heartbeats have been silent for a while.
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::milliseconds(kAliveTimeoutMs);
  while (std::chrono::steady_clock::now() < deadline) {
    const auto closed = client.CloseSession(session, kCloseTimeoutMs);
    if (closed && closed->status == session_closed_t::OK) return closed->cumulative;
    if (closed && closed->status == session_closed_t::UNKNOWN_SESSION) return std::nullopt;
    backend->Tick(200);
  }
  return std::nullopt;
}

}  // namespace mapmend
