#pragma once

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <list>
#include <stdexcept>
#include <vector>

namespace mapmend {

// A link that can be cut, between a client and a server of this host. While it is cut nothing passes and nobody is
// told: connections stay open, and new ones are answered by the kernel alone.
class TcpProxy {
 public:
  // In memory that another process may share.
  struct Control {
    std::atomic<bool> is_cut{false};
    std::atomic<int> delay_ms{0};  // each way
    std::atomic<int64_t> bytes_up{0}, num_connections{0};
  };

  TcpProxy(int server_port, Control* control) : server_port_(server_port), control_(control) {
    listener_ = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    sockaddr_in address = Loopback(0);
    socklen_t length = sizeof(address);
    if (bind(listener_, reinterpret_cast<sockaddr*>(&address), length) != 0 || listen(listener_, 64) != 0)
      throw std::runtime_error("proxy: cannot listen");
    getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &length);
    port_ = ntohs(address.sin_port);
  }
  ~TcpProxy() {
    for (Pair& pair : pairs_) pair.Close();
    close(listener_);
  }
  TcpProxy(const TcpProxy&) = delete;
  TcpProxy& operator=(const TcpProxy&) = delete;

  int Port() const { return port_; }

  void Spin(int timeout_ms) {
    std::vector<pollfd> descriptors;
    const bool is_cut = control_->is_cut;
    if (!is_cut) {
      descriptors.push_back({listener_, POLLIN, 0});
      for (const Pair& pair : pairs_) {
        for (int side = 0; side < 2; ++side) {
          const short events = static_cast<short>((pair.way[side].Bytes() < kMaxBytes ? POLLIN : 0) |
                                                  (pair.way[1 - side].IsDue() ? POLLOUT : 0));
          descriptors.push_back({pair.fd[side], events, 0});
        }
      }
    }
    poll(descriptors.data(), descriptors.size(), control_->delay_ms > 0 || is_cut ? 2 : timeout_ms);
    if (is_cut) return;
    size_t next = 1;
    for (auto it = pairs_.begin(); it != pairs_.end(); next += 2) {
      if (Serve(&*it, descriptors[next].revents, descriptors[next + 1].revents)) {
        ++it;
      } else {
        it->Close();
        it = pairs_.erase(it);
      }
    }
    if (descriptors[0].revents != 0) Accept();
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr size_t kMaxBytes = 256 << 10;

  // What is on its way in one direction.
  struct Way {
    struct Piece {
      std::vector<uint8_t> bytes;
      Clock::time_point due;
    };
    std::deque<Piece> pieces;
    size_t Bytes() const {
      size_t bytes = 0;
      for (const Piece& piece : pieces) bytes += piece.bytes.size();
      return bytes;
    }
    bool IsDue() const { return !pieces.empty() && Clock::now() >= pieces.front().due; }
  };
  struct Pair {
    int fd[2] = {-1, -1};  // client, server
    Way way[2];            // from that side
    void Close() {
      close(fd[0]);
      close(fd[1]);
    }
  };

  static sockaddr_in Loopback(int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<uint16_t>(port));
    return address;
  }

  void Accept() {
    const int client = accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (client < 0) return;
    const int server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_in address = Loopback(server_port_);
    if (connect(server, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
      close(client);
      close(server);
      return;
    }
    fcntl(server, F_SETFL, O_NONBLOCK);
    const int one = 1;
    for (const int fd : {client, server}) setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof(one));
    pairs_.emplace_back();
    pairs_.back().fd[0] = client;
    pairs_.back().fd[1] = server;
    ++control_->num_connections;
  }

  bool Serve(Pair* pair, short client_events, short server_events) {
    const short events[2] = {client_events, server_events};
    for (int side = 0; side < 2; ++side) {
      if (events[side] & (POLLIN | POLLHUP | POLLERR)) {
        std::vector<uint8_t> bytes(64 << 10);
        const ssize_t n = recv(pair->fd[side], bytes.data(), bytes.size(), 0);
        if (n == 0 || (n < 0 && errno != EAGAIN)) return false;
        if (n > 0) {
          bytes.resize(static_cast<size_t>(n));
          if (side == 0) control_->bytes_up += n;
          pair->way[side].pieces.push_back(
              {std::move(bytes), Clock::now() + std::chrono::milliseconds(control_->delay_ms)});
        }
      }
      Way& way = pair->way[side];
      while (way.IsDue()) {
        auto& bytes = way.pieces.front().bytes;
        const ssize_t n = send(pair->fd[1 - side], bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n < 0 && errno != EAGAIN) return false;
        if (n < 0) break;
        bytes.erase(bytes.begin(), bytes.begin() + n);
        if (!bytes.empty()) break;
        way.pieces.pop_front();
      }
    }
    return true;
  }

  int server_port_, listener_ = -1, port_ = 0;
  Control* control_;
  std::list<Pair> pairs_;
};

}  // namespace mapmend
