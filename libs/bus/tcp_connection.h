#pragma once

#include <netinet/in.h>

#include <chrono>
#include <string>

#include "libs/base/range.h"
#include "libs/bus/liveness.h"
#include "libs/bus/tcp_frames.h"

namespace mapmend {

// One attempt to connect to a hub, and what becomes of it: connecting, greeted, over. Never waits. Used by one thread.
class TcpConnection {
 public:
  using Clock = std::chrono::steady_clock;
  struct Options {
    int connect_timeout_ms = 3000;  // until the hub's greeting is there
    int dead_after_ms = 3500;       // see Liveness

    template <typename Visitor>
    void Visit(Visitor& v) {
      v("connect_timeout_ms", connect_timeout_ms, Range(1, 3.6e6), "ms");
      v("dead_after_ms", dead_after_ms, Range(1, 3.6e6), "ms");
    }
  };
  TcpConnection(const sockaddr_in& address, const Options& options);
  ~TcpConnection();
  TcpConnection(const TcpConnection&) = delete;
  TcpConnection& operator=(const TcpConnection&) = delete;

  int fd() const { return fd_; }
  bool IsConnecting() const { return state_ == State::kConnecting; }
  bool IsGreeted() const { return parser_.greeted(); }
  // Each of these returns false when the connection is over; error() says why.
  bool OnWritable();  // ends the connecting, sends the greeting
  bool OnReadable(const FrameParser::OnMessage& on_message);
  bool IsAlive(Clock::time_point now);
  const std::string& error() const { return error_; }
  void Fail(const std::string& error) { error_ = error; }

  Liveness* liveness() { return &liveness_; }

 private:
  bool FailWithErrno(int error);
  void ApplyUserTimeout();

  enum class State { kConnecting, kConnected };
  const Options options_;
  int fd_ = -1;
  State state_ = State::kConnecting;
  FrameParser parser_;
  Liveness liveness_;
  int user_timeout_ms_ = 0;
  Clock::time_point begun_;
  std::string error_;
};

}  // namespace mapmend
