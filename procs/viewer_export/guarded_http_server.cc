#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/sockios.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <condition_variable>
#include <deque>
#include <list>
#include <mutex>
#include <thread>
#include <utility>

#include "procs/viewer_export/live_guard.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr int kBacklog = 128;
constexpr int kSendBuffer = 512 << 10;  // bytes; what fits leaves the worker at once

struct Connection {
  explicit Connection(int descriptor) : fd(descriptor), accepted(Clock::now()) {
    sockaddr_storage peer{};
    socklen_t size = sizeof(peer);
    if (getpeername(fd, reinterpret_cast<sockaddr*>(&peer), &size) != 0) return;
    char text[INET6_ADDRSTRLEN] = "";
    if (peer.ss_family == AF_INET) {
      const auto* in = reinterpret_cast<const sockaddr_in*>(&peer);
      inet_ntop(AF_INET, &in->sin_addr, text, sizeof(text));
      port = ntohs(in->sin_port);
    } else if (peer.ss_family == AF_INET6) {
      const auto* in = reinterpret_cast<const sockaddr_in6*>(&peer);
      inet_ntop(AF_INET6, &in->sin6_addr, text, sizeof(text));
      port = ntohs(in->sin6_port);
    }
    address = text;
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection() {
    if (fd >= 0) close(fd);
  }
  bool IsLocal() const { return address.starts_with("127.") || address == "::1"; }

  int fd;  // -1: given away
  const Clock::time_point accepted;
  std::string address;
  int port = 0;
  std::string request;                     // what has come of it
  GuardedHttpServer::TakeConnection take;  // who has it after the answer; empty: it is closed
};

thread_local Connection* answered_now = nullptr;

// One request that has come in full, and its answer.
class AnsweringStream : public httplib::Stream {
 public:
  AnsweringStream(Connection* connection, const HttpLimits& limits)
      : connection_(connection), limits_(limits), begun_(Clock::now()) {}

  bool is_readable() const override { return read_ < connection_->request.size(); }
  bool is_writable() const override { return true; }
  ssize_t read(char* data, size_t size) override {
    const size_t n = connection_->request.copy(data, size, read_);
    read_ += n;
    return n == 0 ? -1 : static_cast<ssize_t>(n);
  }
  ssize_t write(const char* data, size_t size) override {
    for (size_t done = 0; done < size;) {
      const ssize_t n = send(connection_->fd, data + done, size - done, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (n > 0) {
        done += static_cast<size_t>(n);
        written_ += n;
      } else if (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR) {
        return -1;
      } else if (!WaitForRoom()) {
        return -1;
      }
    }
    return static_cast<ssize_t>(size);
  }
  void get_remote_ip_and_port(std::string& ip, int& port) const override {
    ip = connection_->address;
    port = connection_->port;
  }
  void get_local_ip_and_port(std::string&, int&) const override {}
  socket_t socket() const override { return connection_->fd; }

 private:
  // What lies in the kernel's buffer does not count as taken.
  bool WaitForRoom() {
    int unsent = 0;
    ioctl(connection_->fd, SIOCOUTQ, &unsent);
    const int64_t taken = written_ - unsent;
    if (Clock::now() > begun_ + limits_.answer_timeout + milliseconds(taken * 1000 / limits_.min_bytes_per_s))
      return false;
    pollfd wait{connection_->fd, POLLOUT, 0};
    return poll(&wait, 1, 500) >= 0 || errno == EINTR;
  }

  Connection* const connection_;
  const HttpLimits& limits_;
  const Clock::time_point begun_;
  size_t read_ = 0;
  int64_t written_ = 0;
};

// The library hands connections to a queue of tasks; here they only go through it.
class AtOnce : public httplib::TaskQueue {
 public:
  void enqueue(std::function<void()> task) override { task(); }
  void shutdown() override {}
};

}  // namespace

struct GuardedHttpServer::Impl {
  using Answer = std::function<void(Connection*)>;
  Impl(const HttpLimits& the_limits, Answer the_answer);
  ~Impl();
  void Add(int fd);
  void AwaitRequests();
  void Read(std::list<std::unique_ptr<Connection>>::iterator it);
  void Work();
  void Wake() const {
    const uint64_t one = 1;
    [[maybe_unused]] const ssize_t n = write(wake, &one, sizeof(one));
  }

  const HttpLimits limits;
  const Answer answer;
  const int wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  std::list<std::unique_ptr<Connection>> waiting;  // of the waiting thread alone, oldest first
  std::mutex mutex;
  std::condition_variable work_came;
  // Guarded by mutex.
  std::vector<std::unique_ptr<Connection>> arrived;
  std::deque<std::unique_ptr<Connection>> complete;
  bool ends = false;
  std::vector<std::thread> threads;
};

GuardedHttpServer::Impl::Impl(const HttpLimits& the_limits, Answer the_answer)
    : limits(the_limits), answer(std::move(the_answer)) {
  threads.emplace_back([this] { AwaitRequests(); });
  for (int i = 0; i < limits.num_workers; ++i) threads.emplace_back([this] { Work(); });
}

GuardedHttpServer::Impl::~Impl() {
  {
    const std::lock_guard lock(mutex);
    ends = true;
  }
  Wake();
  work_came.notify_all();
  for (std::thread& thread : threads) thread.join();
  close(wake);
}

void GuardedHttpServer::Impl::Add(int fd) {
  fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
  setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof(kSendBuffer));
  const std::lock_guard lock(mutex);
  arrived.push_back(std::make_unique<Connection>(fd));
  Wake();
}

void GuardedHttpServer::Impl::AwaitRequests() {
  for (;;) {
    {
      const std::lock_guard lock(mutex);
      if (ends) return;
      for (auto& connection : arrived) waiting.push_back(std::move(connection));
      arrived.clear();
    }
    // From the newest on, so that those who wait longest make room.
    std::map<std::string, int> per_host;
    int num_waiting = 0;
    for (auto it = waiting.rbegin(); it != waiting.rend();) {
      const Connection& connection = **it;
      const bool fits = ++num_waiting <= limits.max_waiting &&
                        (connection.IsLocal() || ++per_host[connection.address] <= limits.max_waiting_per_host);
      if (fits && Clock::now() < connection.accepted + limits.request_timeout) {
        ++it;
      } else {
        --num_waiting;
        it = std::make_reverse_iterator(waiting.erase(std::next(it).base()));
      }
    }
    std::vector<pollfd> polled{{wake, POLLIN, 0}};
    for (const auto& connection : waiting) polled.push_back({connection->fd, POLLIN, 0});
    poll(polled.data(), polled.size(), waiting.empty() ? -1 : 250);
    uint64_t ignored = 0;
    [[maybe_unused]] const ssize_t n = read(wake, &ignored, sizeof(ignored));
    size_t i = 1;
    for (auto it = waiting.begin(); it != waiting.end(); ++i) {
      const auto next = std::next(it);
      if (polled[i].revents != 0) Read(it);
      it = next;
    }
  }
}

void GuardedHttpServer::Impl::Read(std::list<std::unique_ptr<Connection>>::iterator it) {
  char buffer[4096];
  Connection& connection = **it;
  const ssize_t n = recv(connection.fd, buffer, sizeof(buffer), MSG_DONTWAIT);
  if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return;
  if (n <= 0) {
    waiting.erase(it);
    return;
  }
  connection.request.append(buffer, static_cast<size_t>(n));
  const size_t end = connection.request.find("\r\n\r\n");
  if (end == std::string::npos) {
    if (connection.request.size() > limits.max_request_bytes) waiting.erase(it);
    return;
  }
  connection.request.resize(end + 4);
  const std::lock_guard lock(mutex);
  complete.push_back(std::move(*it));
  waiting.erase(it);
  // More than that cannot be answered in time, and would only take descriptors.
  if (complete.size() > static_cast<size_t>(limits.max_waiting)) complete.pop_front();
  work_came.notify_one();
}

void GuardedHttpServer::Impl::Work() {
  for (;;) {
    std::unique_ptr<Connection> connection;
    {
      std::unique_lock lock(mutex);
      work_came.wait(lock, [this] { return ends || !complete.empty(); });
      if (ends) return;
      connection = std::move(complete.front());
      complete.pop_front();
    }
    answered_now = connection.get();
    answer(connection.get());
    answered_now = nullptr;
    if (connection->take) {
      connection->take(std::exchange(connection->fd, -1), connection->address);
    } else {
      shutdown(connection->fd, SHUT_WR);
    }
  }
}

GuardedHttpServer::GuardedHttpServer(const HttpLimits& limits) {
  new_task_queue = [] { return new AtOnce; };
  impl_ = std::make_unique<Impl>(limits, [this](Connection* connection) {
    AnsweringStream stream(connection, impl_->limits);
    bool closed = false;
    process_request(stream, /*close_connection=*/true, closed, nullptr);
  });
}

GuardedHttpServer::~GuardedHttpServer() = default;

bool GuardedHttpServer::Bind(const std::string& address, int port) {
  return bind_to_port(address, port) && ::listen(svr_sock_, kBacklog) == 0;
}

void GuardedHttpServer::KeepConnection(const std::string& content_type, TakeConnection take,
                                       httplib::Response* response) {
  // Sends the head alone, without a length.
  response->set_content_provider(content_type, [](size_t, httplib::DataSink& sink) {
    sink.done();
    return true;
  });
  if (answered_now != nullptr) answered_now->take = std::move(take);
}

bool GuardedHttpServer::process_and_close_socket(socket_t socket) {
  impl_->Add(socket);
  return true;
}

}  // namespace mapmend
