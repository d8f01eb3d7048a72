#include "procs/viewer_export/event_streams.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <list>
#include <map>
#include <mutex>
#include <thread>
#include <vector>

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

struct Stream {
  Stream(int descriptor, std::string host, int64_t seen)
      : fd(descriptor), address(std::move(host)), version(seen), last_taken(Clock::now()), last_sent(last_taken) {}
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  ~Stream() { close(fd); }
  bool IsLocal() const { return address.starts_with("127.") || address == "::1"; }

  const int fd;
  const std::string address;
  int64_t version = 0;  // that the page has, once it has taken all of `pending`
  std::string pending;
  size_t taken = 0;  // of pending
  Clock::time_point last_taken, last_sent;
  bool is_first = true;
};

// What the page has seen of this epoch.
int64_t VersionOf(const std::string& event_id, const std::string& epoch) {
  const size_t colon = event_id.find(':');
  if (colon == std::string::npos || event_id.substr(0, colon) != epoch) return 0;
  int64_t version = 0;
  std::from_chars(event_id.data() + colon + 1, event_id.data() + event_id.size(), version);
  return std::max<int64_t>(version, 0);
}

}  // namespace

struct EventStreams::Impl {
  Impl(const LiveFeed* the_feed, const StreamLimits& the_limits) : feed(the_feed), limits(the_limits) {}
  void Run();
  void TakeNew();
  void MakeRoom();
  // When this stream wants to be looked at again; drops it (true) if it is to go.
  bool Serve(Stream* stream, Clock::time_point* next);
  void Prepare(Stream* stream, Clock::time_point now);
  void Signal() const {
    const uint64_t one = 1;
    [[maybe_unused]] const ssize_t n = write(wake, &one, sizeof(one));
  }

  const LiveFeed* const feed;
  const StreamLimits limits;
  const int wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  std::list<std::unique_ptr<Stream>> streams;  // of the thread alone, oldest first
  std::mutex mutex;
  std::vector<std::unique_ptr<Stream>> arrived;  // guarded by mutex
  std::atomic<int> num_streams = 0;
  std::atomic<int64_t> oldest_version = 0;  // that a page has in full
  std::atomic<bool> ends = false;
  std::thread thread;
};

void EventStreams::Impl::TakeNew() {
  const std::lock_guard lock(mutex);
  for (auto& stream : arrived) streams.push_back(std::move(stream));
  arrived.clear();
}

void EventStreams::Impl::MakeRoom() {
  for (;;) {
    std::map<std::string, int> per_host;
    for (const auto& stream : streams) ++per_host[stream->address];
    const Stream* crowded = nullptr;  // the oldest of the host with most
    for (const auto& stream : streams) {
      const bool is_too_many = static_cast<int>(streams.size()) > limits.max_streams ||
                               (!stream->IsLocal() && per_host[stream->address] > limits.max_streams_per_host);
      if (is_too_many && (crowded == nullptr || per_host[stream->address] > per_host[crowded->address]))
        crowded = stream.get();
    }
    if (crowded == nullptr) return;
    streams.remove_if([&](const auto& stream) { return stream.get() == crowded; });
  }
}

void EventStreams::Impl::Prepare(Stream* stream, Clock::time_point now) {
  const LiveFeed::Message message = feed->Since(stream->version, limits.message_bytes);
  stream->version = message.version;
  stream->taken = 0;
  stream->pending.clear();
  if (stream->is_first) stream->pending = "retry: 1000\n\n";
  stream->is_first = false;
  if (!message.json.empty()) {
    stream->pending +=
        "id: " + feed->Epoch() + ":" + std::to_string(message.version) + "\ndata: " + message.json + "\n\n";
  } else if (stream->pending.empty()) {
    stream->pending = ":\n\n";
  }
  stream->last_sent = now;
  stream->last_taken = now;
}

bool EventStreams::Impl::Serve(Stream* stream, Clock::time_point* next) {
  char ignored[512];
  const ssize_t received = recv(stream->fd, ignored, sizeof(ignored), MSG_DONTWAIT);
  if (received == 0 || (received < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) return true;
  for (;;) {
    const auto now = Clock::now();
    if (stream->taken == stream->pending.size()) {
      const bool is_behind = stream->version < feed->Version();
      const bool caught_up_before = stream->pending.size() < limits.message_bytes / 2;
      const auto due = stream->is_first ? now
                       : is_behind      ? stream->last_sent + (caught_up_before ? limits.interval : milliseconds(0))
                                        : stream->last_sent + limits.keep_alive;
      if (now < due) {
        *next = std::min(*next, due);
        return false;
      }
      Prepare(stream, now);
    }
    const ssize_t n = send(stream->fd, stream->pending.data() + stream->taken, stream->pending.size() - stream->taken,
                           MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n > 0) {
      stream->taken += static_cast<size_t>(n);
      stream->last_taken = now;
    } else if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR) {
      if (now > stream->last_taken + limits.stall_timeout) return true;
      *next = std::min(*next, stream->last_taken + limits.stall_timeout + milliseconds(1));
      return false;
    } else {
      return true;
    }
  }
}

void EventStreams::Impl::Run() {
  while (!ends) {
    TakeNew();
    MakeRoom();
    num_streams = static_cast<int>(streams.size());  // whoever is sent something has been counted
    auto next = Clock::now() + std::chrono::hours(1);
    int64_t oldest = feed->Version();
    for (auto it = streams.begin(); it != streams.end();) {
      if (Serve(it->get(), &next)) {
        it = streams.erase(it);
      } else {
        const Stream& stream = **it;
        oldest = std::min(oldest, stream.taken == stream.pending.size() ? stream.version : stream.version - 1);
        ++it;
      }
    }
    num_streams = static_cast<int>(streams.size());
    oldest_version = oldest;
    std::vector<pollfd> polled{{wake, POLLIN, 0}};
    for (const auto& stream : streams) {
      const bool is_waiting = stream->taken < stream->pending.size();
      polled.push_back({stream->fd, static_cast<short>(is_waiting ? POLLIN | POLLOUT : POLLIN), 0});
    }
    const auto wait = std::chrono::ceil<milliseconds>(next - Clock::now()).count();
    poll(polled.data(), polled.size(), static_cast<int>(std::clamp<int64_t>(wait, 0, 60000)));
    uint64_t ignored = 0;
    [[maybe_unused]] const ssize_t n = read(wake, &ignored, sizeof(ignored));
  }
  streams.clear();
}

EventStreams::EventStreams(const LiveFeed* feed, const StreamLimits& limits)
    : impl_(std::make_unique<Impl>(feed, limits)) {
  impl_->thread = std::thread([this] { impl_->Run(); });
}

EventStreams::~EventStreams() {
  impl_->ends = true;
  impl_->Signal();
  impl_->thread.join();
  close(impl_->wake);
}

void EventStreams::Add(int fd, const std::string& address, const std::string& last_event_id) {
  fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->arrived.push_back(std::make_unique<Stream>(fd, address, VersionOf(last_event_id, impl_->feed->Epoch())));
  }
  impl_->Signal();
}

int EventStreams::NumStreams() const { return impl_->num_streams; }

void EventStreams::Wake() { impl_->Signal(); }

void EventStreams::Flush(milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  const int64_t wanted = impl_->feed->Version();
  impl_->Signal();
  while (Clock::now() < deadline && impl_->num_streams > 0 && impl_->oldest_version < wanted)
    std::this_thread::sleep_for(milliseconds(5));
}

}  // namespace mapmend
