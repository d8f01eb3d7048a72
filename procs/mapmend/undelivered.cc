#include "procs/mapmend/undelivered.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <stdexcept>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/wire/outbox.h"
#include "libs/wire/store_client.h"
#include "libs/wire/stream_sender.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> ListOutboxes(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".outbox") paths.push_back(entry.path().string());
  }
  return paths;
}

// Which session an outbox belongs to; empty if everything in it was acknowledged.
std::string SessionThatWaits(const std::string& path) {
  const Outbox outbox(path);
  return outbox.Empty() ? "" : outbox.Session();
}

}  // namespace

Undelivered::Undelivered(const std::string& out, const std::string& lcm_url, const std::string& channel_prefix,
                         const std::string& flying)
    : folder_(out + "/undelivered"), lcm_url_(lcm_url), channel_prefix_(channel_prefix), flying_(flying) {
  const std::string current = out + "/outbox";
  if (fs::exists(current)) {
    const std::string session = SessionThatWaits(current);
    std::error_code error;
    if (session.empty()) {
      fs::remove(current, error);
    } else {
      fs::create_directories(folder_, error);
      if (!error) fs::rename(current, folder_ + "/" + session + ".outbox", error);
    }
    if (error) throw std::runtime_error(current + ": cannot be put aside: " + error.message());
  }
  num_waiting_ = static_cast<int>(ListOutboxes(folder_).size());
  if (num_waiting_ > 0) thread_ = std::thread([this] { Run(); });
}

Undelivered::~Undelivered() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

void Undelivered::Run() {
  Bus bus(lcm_url_, channel_prefix_);
  StoreClient store(&bus, "undelivered-" + std::to_string(getpid()));
  while (!stop_ && num_waiting_ > 0) {
    for (const std::string& path : ListOutboxes(folder_)) {
      if (stop_) return;
      try {
        if (!Deliver(&bus, &store, path)) continue;
        std::error_code ignored;
        fs::remove(path, ignored);
        spdlog::info("session {} delivered", fs::path(path).stem().string());
      } catch (const std::exception& e) {
        spdlog::warn("{}", e.what());
      }
    }
    num_waiting_ = static_cast<int>(ListOutboxes(folder_).size());
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
}

bool Undelivered::Deliver(Bus* bus, StoreClient* store, const std::string& path) const {
  constexpr int kPatienceMs = 2000;  // so that the end is not waited for longer
  const std::string session = SessionThatWaits(path);
  // An outbox that is empty was delivered before the last end: its session may still be open.
  const std::string id = session.empty() ? fs::path(path).stem().string() : session;
  if (is_flying_ && id == flying_) return false;
  if (!session.empty() && !DeliverOutbox(bus, path, kPatienceMs)) return false;
  const auto closed = store->CloseSession(id, kPatienceMs);
  return closed && closed->status != CloseAnswer::Status::kStillAlive;
}

}  // namespace mapmend
