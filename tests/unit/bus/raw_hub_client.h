#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <stdexcept>
#include <string>

#include "libs/bus/hub.h"

namespace mapmend {

// A client that speaks LCM's TCP protocol byte by byte; the hub is served by the test between its steps.
class RawClient {
 public:
  explicit RawClient(Hub* hub, int receive_buffer = 0, uint32_t host = INADDR_LOOPBACK)
      : hub_(hub), fd_(socket(AF_INET, SOCK_STREAM, 0)) {
    if (receive_buffer > 0) setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof(receive_buffer));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(hub->Port()));
    address.sin_addr.s_addr = htonl(host);
    if (connect(fd_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0) throw std::runtime_error("connect");
  }
  ~RawClient() { close(fd_); }

  void SendRaw(const std::string& bytes) {
    size_t sent = 0;
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (sent < bytes.size() && std::chrono::steady_clock::now() < end) {
      const ssize_t n = send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK) break;  // disconnected
      if (n > 0) sent += static_cast<size_t>(n);
      hub_->Spin(1);
    }
    all_sent_ = sent == bytes.size();
    Serve();
  }
  static std::string U32(uint32_t v) {
    const uint32_t n = htonl(v);
    return std::string(reinterpret_cast<const char*>(&n), 4);
  }
  static std::string Text(const std::string& s) { return U32(static_cast<uint32_t>(s.size())) + s; }
  void Greet() { SendRaw(U32(0x287617fb) + U32(0x0100)); }
  void Subscribe(const std::string& pattern) { SendRaw(U32(2) + Text(pattern)); }
  void Unsubscribe(const std::string& pattern) { SendRaw(U32(3) + Text(pattern)); }
  void Publish(const std::string& channel, const std::string& data) { SendRaw(U32(1) + Text(channel) + Text(data)); }
  bool all_sent() const { return all_sent_; }
  int fd() const { return fd_; }

  // All that has come.
  std::string Receive() {
    Serve();
    std::string bytes;
    char buffer[65536];
    for (;;) {
      const ssize_t n = recv(fd_, buffer, sizeof(buffer), MSG_DONTWAIT);
      if (n <= 0) break;
      bytes.append(buffer, static_cast<size_t>(n));
      hub_->Spin(0);
    }
    return bytes;
  }
  bool IsClosed() {
    Serve();
    char byte;
    return recv(fd_, &byte, 1, MSG_DONTWAIT | MSG_PEEK) == 0;
  }

 private:
  void Serve() {
    for (int i = 0; i < 3; ++i) hub_->Spin(1);
  }
  Hub* hub_;
  int fd_;
  bool all_sent_ = false;
};

inline HubOptions OnAnyPort() {
  HubOptions options;
  options.port = 0;
  return options;
}

inline const std::string kGreeting = RawClient::U32(0x287617fa) + RawClient::U32(0x0100);

inline std::string Message(const std::string& channel, const std::string& data) {
  return RawClient::U32(1) + RawClient::Text(channel) + RawClient::Text(data);
}

}  // namespace mapmend
