#include "procs/mapmend/session_rescue.h"

#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <mapmend/cursor_t.hpp>
#include <mapmend/fetch_t.hpp>
#include <mapmend/fetched_t.hpp>
#include <mapmend/session_closed_t.hpp>
#include <stdexcept>

#include "libs/bus/store_client.h"
#include "libs/bus/stream_sender.h"

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

std::vector<StoredSession> ListSessions(Bus* bus) {
  StoreClient client(bus, "launcher-" + std::to_string(getpid()));
  const auto reply = client.Fetch(fetch_t{});
  if (!reply) throw std::runtime_error("the store does not answer");
  std::vector<StoredSession> sessions;
  for (const cursor_t& cursor : reply->sessions) sessions.push_back({cursor.session, cursor.seq});
  return sessions;
}

}  // namespace mapmend
