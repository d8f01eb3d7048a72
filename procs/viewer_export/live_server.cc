#include "procs/viewer_export/live_server.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "libs/base/write_file.h"
#include "libs/bus/access_token.h"
#include "procs/viewer_export/event_streams.h"
#include "procs/viewer_export/live_guard.h"
#include "procs/viewer_export/live_questions.h"
#include "procs/viewer_export/mosaic_tiles.h"
#include "procs/viewer_export/web_files.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr int kMaxFilesAtOnce = 8;  // so that workers are left for the page
constexpr milliseconds kAnswerPatience(15000);
constexpr milliseconds kFlush(500);
constexpr int kWrongTokens = 5;  // within the interval; afterwards none is looked at for so long
constexpr milliseconds kTokenInterval(10000);
constexpr char kTokenHeader[] = "X-Mapmend-Token";

// The page has all it needs here and nothing in its markup that acts. Styles that scripts set are no inline styles.
constexpr char kPagePolicy[] =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
// The report is one file with its style and pictures in it.
constexpr char kReportPolicy[] =
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";
// Other files of the results are never pages that act.
constexpr char kFilePolicy[] = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox";

int ToInt(const std::string& text) {
  int value = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() ? value : -1;
}

void Refuse(int status, const std::string& why, httplib::Response* response) {
  response->status = status;
  response->set_content(why, "text/plain; charset=utf-8");
}

}  // namespace

struct LiveServer::Impl {
  Impl(const LiveServerOptions& the_options, LiveFeed* the_feed, LiveQuestions* the_questions)
      : options(the_options),
        feed(the_feed),
        questions(the_questions),
        tiles(the_options.files + "/" + kTilesFile),
        streams(the_feed) {}

  const LiveServerOptions options;
  LiveFeed* const feed;
  LiveQuestions* const questions;
  MosaicTiles tiles;
  std::vector<std::string> own_names = OwnHostNames();
  std::atomic<int> num_files = 0;  // being sent
  std::mutex token_mutex;
  std::vector<Clock::time_point> wrong_tokens;  // guarded by token_mutex
  EventStreams streams;
  GuardedHttpServer server;  // uses what stands before it
  std::thread thread;

  void Answer(const httplib::Request& request, httplib::Response* response);
  void AnswerGet(const httplib::Request& request, httplib::Response* response);
  void AnswerFromResults(const std::string& path, httplib::Response* response);
  void AnswerWithFile(const std::string& path, httplib::Response* response);
  void AnswerWithTile(const std::string& path, httplib::Response* response);
  void AnswerWithPicture(const httplib::Request& request, httplib::Response* response);
  void Decide(const httplib::Request& request, httplib::Response* response);
  void Stream(const httplib::Request& request, httplib::Response* response);
  // Empty, or why not; too many wrong ones are not even compared.
  std::string CheckToken(const std::string& token);
  void AnswerByQuestion(const LiveQuestions::Question& question, httplib::Response* response) const;
};

void LiveServer::Impl::Answer(const httplib::Request& request, httplib::Response* response) {
  response->set_header("X-Content-Type-Options", "nosniff");
  response->set_header("Referrer-Policy", "no-referrer");
  response->set_header("Cross-Origin-Resource-Policy", "same-origin");
  response->set_header("Cross-Origin-Opener-Policy", "same-origin");
  if (const std::string why = CheckHostAndOrigin(request, own_names); !why.empty()) return Refuse(403, why, response);
  if (request.method == "POST" && request.path == "/edge") return Decide(request, response);
  if (request.method != "GET" && request.method != "HEAD") return Refuse(405, "Only GET and HEAD.\n", response);
  AnswerGet(request, response);
}

void LiveServer::Impl::AnswerGet(const httplib::Request& request, httplib::Response* response) {
  const std::string& path = request.path;
  response->set_header("Cache-Control", "no-cache");
  if (const auto file = FindWebFile(path)) {
    response->set_header("Content-Security-Policy", kPagePolicy);
    return response->set_content(std::string(file->content), file->type);
  }
  if (path.starts_with("/lib/")) {
    const std::string library =
        FindLibraryFile(path, options.javascript.empty() ? std::string("/usr/share/javascript") : options.javascript);
    std::error_code error;
    if (library.empty() || !std::filesystem::is_regular_file(library, error))
      return Refuse(404, "There is no such library: install libjs-three and libjs-leaflet.\n", response);
    return response->set_content(ReadFile(library), ContentType(path));
  }
  if (path == "/favicon.ico") {  // some ask for it whatever the page says
    response->status = 204;
    return;
  }
  if (path == "/events") return Stream(request, response);
  if (path == "/state.json") return response->set_content(feed->Values(), "application/json");
  if (path == "/edge.jpg" || path == "/keyframe.jpg") return AnswerWithPicture(request, response);
  if (path.starts_with("/tiles/")) return AnswerWithTile(path.substr(7), response);
  AnswerFromResults(path, response);
}

void LiveServer::Impl::AnswerFromResults(const std::string& path, httplib::Response* response) {
  const std::string prefix = "/files/";
  if (!options.files.empty() && path == "/report") {
    response->set_header("Content-Security-Policy", kReportPolicy);
    AnswerWithFile("report.html", response);
    if (response->status == 404) Refuse(404, "There is no report yet.\n", response);
  } else if (!options.files.empty() && path.starts_with(prefix)) {
    response->set_header("Content-Security-Policy", kFilePolicy);
    AnswerWithFile(path.substr(prefix.size()), response);
  } else {
    Refuse(404, "There is no such page.\n", response);
  }
}

void LiveServer::Impl::AnswerWithFile(const std::string& path, httplib::Response* response) {
  int64_t size = 0;
  const int fd = OpenBelow(options.files, path, &size);
  if (fd < 0) return Refuse(404, "There is no such file.\n", response);
  if (++num_files > kMaxFilesAtOnce || size == 0) {
    --num_files;
    close(fd);
    if (size == 0) return response->set_content("", ContentType(path));
    response->set_header("Retry-After", "5");
    return Refuse(503, "Too many files are being sent: try again.\n", response);
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

void LiveServer::Impl::AnswerWithTile(const std::string& path, httplib::Response* response) {
  const size_t first = path.find('/'), second = path.find('/', first + 1);
  if (options.files.empty() || first == std::string::npos || second == std::string::npos)
    return Refuse(404, "There is no such tile.\n", response);
  const std::string tile = tiles.Tile(ToInt(path.substr(0, first)), ToInt(path.substr(first + 1, second - first - 1)),
                                      ToInt(path.substr(second + 1)));
  if (tile.empty()) return Refuse(404, "There is no such tile.\n", response);
  response->set_content(tile, ImageType(tile));
}

void LiveServer::Impl::AnswerByQuestion(const LiveQuestions::Question& question, httplib::Response* response) const {
  const LiveQuestions::Answer answer = questions->Ask(question, kAnswerPatience);
  response->status = answer.status;
  response->set_content(answer.content, answer.type.c_str());
}

void LiveServer::Impl::AnswerWithPicture(const httplib::Request& request, httplib::Response* response) {
  LiveQuestions::Question question;
  const bool is_edge = request.path == "/edge.jpg";
  question.kind =
      is_edge ? LiveQuestions::Question::Kind::kEdgePicture : LiveQuestions::Question::Kind::kKeyframePicture;
  question.a = request.get_param_value(is_edge ? "a" : "submap");
  question.b = request.get_param_value("b");
  question.keyframe = ToInt(request.get_param_value("id"));
  question.features = request.get_param_value("features") != "0";
  AnswerByQuestion(question, response);
}

std::string LiveServer::Impl::CheckToken(const std::string& token) {
  if (options.token.empty()) return "This page cannot act: it was started without a token.\n";
  const std::lock_guard lock(token_mutex);
  const auto now = Clock::now();
  std::erase_if(wrong_tokens, [&](Clock::time_point t) { return t + kTokenInterval < now; });
  if (wrong_tokens.size() >= kWrongTokens) return "Too many wrong tokens: wait ten seconds.\n";
  if (TokensAreEqual(token, options.token)) return "";
  wrong_tokens.push_back(now);
  return "The token is wrong: it was printed when the run was started.\n";
}

// The header cannot be set by a page of another site without asking first, and that question is refused.
void LiveServer::Impl::Decide(const httplib::Request& request, httplib::Response* response) {
  if (const std::string why = CheckToken(request.get_header_value(kTokenHeader)); !why.empty())
    return Refuse(403, why, response);
  LiveQuestions::Question question;
  question.kind = LiveQuestions::Question::Kind::kDecision;
  question.a = request.get_param_value("a");
  question.b = request.get_param_value("b");
  const std::string disabled = request.get_param_value("disabled");
  if (disabled != "0" && disabled != "1") return Refuse(400, "Say disabled=0 or disabled=1.\n", response);
  question.disabled = disabled == "1";
  AnswerByQuestion(question, response);
}

void LiveServer::Impl::Stream(const httplib::Request& request, httplib::Response* response) {
  if (request.method != "GET") return Refuse(405, "Only GET.\n", response);
  std::string seen = request.get_header_value("Last-Event-ID");
  if (seen.empty()) seen = request.get_param_value("since");
  response->set_header("X-Accel-Buffering", "no");
  GuardedHttpServer::KeepConnection(
      "text/event-stream", [this, seen](int fd, const std::string& address) { streams.Add(fd, address, seen); },
      response);
}

LiveServer::LiveServer(const LiveServerOptions& options, LiveFeed* feed, LiveQuestions* questions)
    : impl_(std::make_unique<Impl>(options, feed, questions)) {
  if (options.bind.find_first_not_of("0123456789.:") != std::string::npos) impl_->own_names.push_back(options.bind);
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
  if (!impl_->server.Bind(options.bind, options.port)) {
    throw std::runtime_error("cannot listen on " + options.bind + ":" + std::to_string(options.port) +
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

void LiveServer::Wake() { impl_->streams.Wake(); }

void LiveServer::Flush() { impl_->streams.Flush(kFlush); }

int LiveServer::NumPages() const { return impl_->streams.NumStreams(); }

std::string LiveServer::Url() const {
  return "http://" + impl_->options.bind + ":" + std::to_string(impl_->options.port) + "/";
}

}  // namespace mapmend
