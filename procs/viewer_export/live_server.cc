#include "procs/viewer_export/live_server.h"

#include <httplib.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "libs/geometry/write_file.h"
#include "procs/viewer_export/live_page.h"

namespace mapmend {
namespace {

constexpr int64_t kInterestMs = 5000;

int64_t NowMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

struct LiveServer::Impl {
  httplib::Server server;
  std::string bind;
  int port = 0;
  std::string files;
  std::atomic<int64_t> last_request_ms = -kInterestMs;
  std::mutex mutex;
  std::string state = "null";  // guarded by mutex
  std::thread thread;

  void AddHandlers();
};

void LiveServer::Impl::AddHandlers() {
  server.Get("/", [](const httplib::Request&, httplib::Response& response) {
    response.set_content(kLivePage, "text/html; charset=utf-8");
  });
  server.Get("/state.json", [this](const httplib::Request&, httplib::Response& response) {
    last_request_ms = NowMs();
    const std::lock_guard lock(mutex);
    response.set_header("Cache-Control", "no-store");
    response.set_content(state, "application/json");
  });
  if (files.empty()) return;
  server.Get("/report", [this](const httplib::Request&, httplib::Response& response) {
    try {
      response.set_content(ReadFile((std::filesystem::path(files) / "report.html").string()),
                           "text/html; charset=utf-8");
    } catch (const std::exception&) {
      response.status = 404;
      response.set_content("There is no report yet.\n", "text/plain");
    }
  });
  server.set_mount_point("/files", files);
}

LiveServer::LiveServer(const std::string& bind, int port, const std::string& files) : impl_(std::make_unique<Impl>()) {
  impl_->bind = bind;
  impl_->port = port;
  impl_->files = files;
  impl_->AddHandlers();
  impl_->server.new_task_queue = [] { return new httplib::ThreadPool(4); };
  // Only SO_REUSEADDR: with SO_REUSEPORT, the library's default, a second viewer would silently share the port.
  impl_->server.set_socket_options([](socket_t socket) {
    const int yes = 1;
    setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  });
  if (!impl_->server.bind_to_port(bind, port)) {
    throw std::runtime_error("cannot listen on " + bind + ":" + std::to_string(port) +
                             ": the port is in use or not allowed (choose another with --port, or 0 for no live page)");
  }
  impl_->thread = std::thread([this] { impl_->server.listen_after_bind(); });
}

LiveServer::~LiveServer() {
  // stop() before the thread has begun to listen would be lost.
  while (impl_->thread.joinable() && !impl_->server.is_running())
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  impl_->server.stop();
  impl_->thread.join();
}

void LiveServer::SetState(std::string json) {
  const std::lock_guard lock(impl_->mutex);
  impl_->state = std::move(json);
}

bool LiveServer::WantsState() const { return NowMs() - impl_->last_request_ms < kInterestMs; }

std::string LiveServer::Url() const { return "http://" + impl_->bind + ":" + std::to_string(impl_->port) + "/"; }

}  // namespace mapmend
