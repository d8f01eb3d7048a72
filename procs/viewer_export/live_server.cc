#include "procs/viewer_export/live_server.h"

#include <unistd.h>
#include <web/live_page.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "procs/viewer_export/live_guard.h"

namespace mapmend {
namespace {

constexpr int64_t kInterestMs = 5000;

int64_t NowMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

constexpr int kMaxFilesAtOnce = 8;  // so that workers are left for the page

const char* ContentType(const std::string& path) {
  static const std::pair<const char*, const char*> kTypes[] = {{".html", "text/html; charset=utf-8"},
                                                               {".json", "application/json"},
                                                               {".svg", "image/svg+xml"},
                                                               {".png", "image/png"},
                                                               {".jpg", "image/jpeg"},
                                                               {".txt", "text/plain; charset=utf-8"},
                                                               {".tum", "text/plain; charset=utf-8"},
                                                               {".csv", "text/csv; charset=utf-8"},
                                                               {".log", "text/plain; charset=utf-8"}};
  for (const auto& [ending, type] : kTypes) {
    if (path.ends_with(ending)) return type;
  }
  return "application/octet-stream";
}

}  // namespace

struct LiveServer::Impl {
  std::string bind;
  int port = 0;
  std::string files;
  std::atomic<int64_t> last_request_ms = -kInterestMs;
  std::mutex mutex;
  std::string state = "null";  // guarded by mutex
  std::vector<std::string> own_names = OwnHostNames();
  std::atomic<int> num_files = 0;  // being sent
  GuardedHttpServer server;        // uses what stands before it
  std::thread thread;

  void Answer(const httplib::Request& request, httplib::Response* response);
  void AnswerWithFile(const std::string& path, httplib::Response* response);
};

void LiveServer::Impl::Answer(const httplib::Request& request, httplib::Response* response) {
  const auto refuse = [&](int status, const std::string& why) {
    response->status = status;
    response->set_content(why, "text/plain");
  };
  response->set_header("X-Content-Type-Options", "nosniff");
  response->set_header("X-Frame-Options", "SAMEORIGIN");
  if (const std::string why = CheckHostAndOrigin(request, own_names); !why.empty()) return refuse(403, why);
  if (request.method != "GET" && request.method != "HEAD") return refuse(405, "Only GET and HEAD.\n");
  if (request.path == "/") return response->set_content(kLivePage, "text/html; charset=utf-8");
  if (request.path == "/favicon.ico") {
    response->status = 204;
    return;
  }
  if (request.path == "/state.json") {
    last_request_ms = NowMs();
    const std::lock_guard lock(mutex);
    response->set_header("Cache-Control", "no-store");
    return response->set_content(state, "application/json");
  }
  const std::string prefix = "/files/";
  if (!files.empty() && request.path == "/report") {
    AnswerWithFile("report.html", response);
    if (response->status == 404) refuse(404, "There is no report yet.\n");
  } else if (!files.empty() && request.path.starts_with(prefix)) {
    AnswerWithFile(request.path.substr(prefix.size()), response);
  } else {
    refuse(404, "There is no such page.\n");
  }
}

void LiveServer::Impl::AnswerWithFile(const std::string& path, httplib::Response* response) {
  int64_t size = 0;
  const int fd = OpenBelow(files, path, &size);
  if (fd < 0) {
    response->status = 404;
    return response->set_content("There is no such file.\n", "text/plain");
  }
  if (++num_files > kMaxFilesAtOnce || size == 0) {
    --num_files;
    close(fd);
    if (size == 0) return response->set_content("", ContentType(path));
    response->status = 503;
    response->set_header("Retry-After", "5");
    return response->set_content("Too many files are being sent: try again.\n", "text/plain");
  }
  response->set_content_provider(
      static_cast<size_t>(size), ContentType(path),
      [fd](size_t offset, size_t length, httplib::DataSink& sink) {
        std::vector<char> piece(std::min<size_t>(length, 256 << 10));
        const ssize_t n = pread(fd, piece.data(), piece.size(), static_cast<off_t>(offset));
        return n > 0 && sink.write(piece.data(), static_cast<size_t>(n));
      },
      [this, fd](bool) {
        close(fd);
        --num_files;
      });
}

LiveServer::LiveServer(const std::string& bind, int port, const std::string& files) : impl_(std::make_unique<Impl>()) {
  impl_->bind = bind;
  impl_->port = port;
  impl_->files = files;
  if (bind.find_first_not_of("0123456789.:") != std::string::npos) impl_->own_names.push_back(bind);
  // Before the library's own routing, which follows symbolic links and reads files as a whole.
  impl_->server.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
    // Any number of ranges could be asked for in one request: more than one are not served apart.
    if (request.ranges.size() > 1) const_cast<httplib::Request&>(request).ranges.clear();
    impl_->Answer(request, &response);
    return httplib::Server::HandlerResponse::Handled;
  });
  // Only SO_REUSEADDR: with SO_REUSEPORT, the library's default, a second viewer would silently share the port.
  impl_->server.set_socket_options([](socket_t socket) {
    const int yes = 1;
    setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  });
  if (!impl_->server.Bind(bind, port)) {
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
