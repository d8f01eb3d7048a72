#include "procs/mapmend/session_rescue.h"

#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <future>
#include <optional>
#include <stdexcept>

#include "libs/wire/outbox.h"
#include "libs/wire/store_client.h"
#include "libs/wire/stream_sender.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

std::string ClientName() { return "launcher-" + std::to_string(getpid()); }

std::vector<std::string> FindOutboxes(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code error;
  const std::string path = folder + "/outbox";
  if (fs::is_regular_file(path, error) && fs::file_size(path, error) > 0) paths.push_back(path);
  return paths;
}

std::string StoreProblem(const Backend& backend) {
  const auto* store = backend.Health("submap_store");
  return store != nullptr && store->state == "error" ? store->message : "the submap store does not answer";
}

// Looks after the processes while another thread works, whose result it returns.
bool TickUntilDone(Backend* backend, std::future<bool> done) {
  while (done.wait_for(milliseconds(0)) != std::future_status::ready) backend->Tick(20);
  return done.get();
}

int64_t LastSeqOf(const std::string& session, Backend* backend) {
  for (const StoredSession& stored : ListSessions(backend->bus())) {
    if (stored.id == session) return stored.last_seq;
  }
  return -1;
}

}  // namespace

bool HoldsUndelivered(const std::string& folder) {
  for (const std::string& path : FindOutboxes(folder)) {
    if (!Outbox(path).Empty()) return true;
  }
  return false;
}

RescueReport DeliverOutboxes(Backend* backend, const std::string& folder) {
  constexpr int kTimeoutMs = 10000;  // without progress
  RescueReport report;
  for (const std::string& path : FindOutboxes(folder)) {
    std::string session;
    {
      const Outbox outbox(path);
      if (outbox.Empty()) continue;
      session = outbox.Session();
    }
    const int64_t last_before = LastSeqOf(session, backend);
    // On a connection of its own, in a thread of its own: the launcher goes on looking after its processes.
    const bool delivered = TickUntilDone(backend, std::async(std::launch::async, [&backend, path] {
                                           Bus bus(backend->Url(), backend->ChannelPrefix());
                                           return DeliverOutbox(&bus, path, kTimeoutMs);
                                         }));
    if (!delivered) throw std::runtime_error(path + ": cannot be delivered: " + StoreProblem(*backend));
    // Some may have been stored without the frontend's having heard of it.
    const int64_t num_new = LastSeqOf(session, backend) - last_before;
    if (num_new <= 0) continue;
    report.changed = true;
    report.lines.push_back(path + ": " + std::to_string(num_new) + " records of session " + session +
                           " had not been stored; they are now");
  }
  return report;
}

std::optional<int64_t> RescueSession(Backend* backend, const std::string& session) {
  // The store takes a frontend for alive until its heartbeats have been silent for a while.
  constexpr int kTimeoutMs = 2000, kAliveTimeoutMs = 20000;
  StoreClient client(backend->bus(), ClientName());
  const auto deadline = Clock::now() + milliseconds(kAliveTimeoutMs);
  while (Clock::now() < deadline) {
    const auto closed = client.CloseSession(session, kTimeoutMs);
    if (closed && closed->status == CloseAnswer::Status::kOk) return closed->cumulative;
    if (closed && closed->status == CloseAnswer::Status::kUnknownSession) return std::nullopt;
    backend->Tick(200);
  }
  return std::nullopt;
}

RescueReport CloseSessions(Backend* backend, const std::set<std::string>& except) {
  RescueReport report;
  StoreClient client(backend->bus(), ClientName());
  for (const auto& [session, last] : ListSessions(backend->bus())) {
    if (except.contains(session)) continue;
    const auto reply = client.Fetch({Addressed(), session, last, last, 1});
    if (!reply) throw std::runtime_error(StoreProblem(*backend));
    if (reply->ended) continue;
    if (!RescueSession(backend, session))
      throw std::runtime_error("session " + session + " cannot be closed: " + StoreProblem(*backend));
    const auto progress = client.AskProgress(session);
    const bool has_frames = progress && progress->last_frame >= 0;
    report.changed = true;
    report.lines.push_back("session " + session + " was cut off" +
                           (has_frames ? " after frame " + std::to_string(progress->last_frame) : "") +
                           ": it is closed");
  }
  return report;
}

RescueReport RescueFolder(Backend* backend, const std::string& folder) {
  RescueReport report = DeliverOutboxes(backend, folder);
  const RescueReport closed = CloseSessions(backend);
  report.lines.insert(report.lines.end(), closed.lines.begin(), closed.lines.end());
  report.changed = report.changed || closed.changed;
  return report;
}

std::set<std::string> SessionNames(Bus* bus) {
  std::set<std::string> names;
  for (const StoredSession& session : ListSessions(bus)) names.insert(session.id);
  return names;
}

std::vector<StoredSession> ListSessions(Bus* bus) {
  StoreClient client(bus, "launcher-" + std::to_string(getpid()));
  const auto reply = client.Fetch(FetchRequest{});
  if (!reply) throw std::runtime_error("the submap store does not answer");
  std::vector<StoredSession> sessions;
  for (const StreamCursor& cursor : reply->sessions) sessions.push_back({cursor.session, cursor.seq});
  return sessions;
}

}  // namespace mapmend
