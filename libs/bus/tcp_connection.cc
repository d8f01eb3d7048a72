#include "libs/bus/tcp_connection.h"

#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "libs/bus/congestion.h"

namespace mapmend {
namespace {

constexpr size_t kReadChunk = 256 << 10;
constexpr int kMaxReadsAtOnce = 8;  // so that writing goes on too
// The kernel takes more only when it has less than this to send, so that a ping does not wait behind megabytes.
constexpr int kMaxUnsentBytes = 256 << 10;

void SetOption(int fd, int level, int name, int value) { setsockopt(fd, level, name, &value, sizeof(value)); }

}  // namespace

TcpConnection::TcpConnection(const sockaddr_in& address, const Options& options)
    : options_(options), liveness_(options.dead_after_ms), begun_(Clock::now()) {
  fd_ = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd_ < 0) {
    FailWithErrno(errno);
    return;
  }
  SetOption(fd_, IPPROTO_TCP, TCP_NODELAY, 1);
  SetOption(fd_, IPPROTO_TCP, TCP_NOTSENT_LOWAT, kMaxUnsentBytes);
  SetOption(fd_, SOL_SOCKET, SO_KEEPALIVE, 1);
  SetOption(fd_, IPPROTO_TCP, TCP_KEEPIDLE, 1);
  SetOption(fd_, IPPROTO_TCP, TCP_KEEPINTVL, 1);
  SetOption(fd_, IPPROTO_TCP, TCP_KEEPCNT, 3);
  PreferBbr(fd_, address);
  ApplyUserTimeout();
  if (connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 && errno != EINPROGRESS)
    FailWithErrno(errno);
}

TcpConnection::~TcpConnection() {
  if (fd_ >= 0) close(fd_);
}

bool TcpConnection::FailWithErrno(int error) {
  error_ = std::strerror(error);
  return false;
}

void TcpConnection::ApplyUserTimeout() {
  const int wanted = liveness_.DeadAfterMs();
  if (std::abs(wanted - user_timeout_ms_) <= wanted / 10) return;
  SetOption(fd_, IPPROTO_TCP, TCP_USER_TIMEOUT, wanted);
  user_timeout_ms_ = wanted;
}

bool TcpConnection::OnWritable() {
  if (state_ != State::kConnecting) return true;
  int error = 0;
  socklen_t size = sizeof(error);
  getsockopt(fd_, SOL_SOCKET, SO_ERROR, &error, &size);
  if (error != 0) return FailWithErrno(error);
  state_ = State::kConnected;
  const std::vector<uint8_t> greeting = GreetingFrame();  // an empty socket has room for it
  if (send(fd_, greeting.data(), greeting.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(greeting.size()))
    return FailWithErrno(errno);
  return true;
}

bool TcpConnection::OnReadable(const FrameParser::OnMessage& on_message) {
  for (int i = 0; i < kMaxReadsAtOnce; ++i) {
    const ssize_t n = recv(fd_, parser_.Room(kReadChunk), kReadChunk, MSG_DONTWAIT);
    if (n < 0) return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR ? true : FailWithErrno(errno);
    if (n == 0) {
      error_ = "the hub has closed the connection";
      return false;
    }
    liveness_.OnSign(Clock::now());
    if (!parser_.Received(static_cast<size_t>(n), on_message)) {
      error_ = "what answers is not a hub";
      return false;
    }
    if (n < static_cast<ssize_t>(kReadChunk)) return true;
  }
  return true;
}

bool TcpConnection::IsAlive(Clock::time_point now) {
  if (!IsGreeted()) {
    if (now - begun_ < std::chrono::milliseconds(options_.connect_timeout_ms)) return true;
    error_ = state_ == State::kConnecting ? "no answer" : "no greeting";
    return false;
  }
  ApplyUserTimeout();
  if (!liveness_.IsDead(now)) return true;
  error_ = "no sign of life for " + std::to_string(liveness_.DeadAfterMs()) + " ms";
  return false;
}

}  // namespace mapmend
