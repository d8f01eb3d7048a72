#include "libs/bus/hub.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <spdlog/spdlog.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <map>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "libs/bus/channels.h"
#include "libs/bus/hub_client.h"

namespace mapmend {

bool IsBestEffortChannel(const std::string& channel) {
  for (const char* name :
       {channels::kFramePose, channels::kImage, channels::kHealth, channels::kAck, channels::kStreamState}) {
    if (channel.ends_with(name)) return true;
  }
  return false;
}

std::string HubOptions::Check() const {
  if (port < 0 || port > 65535) return "port must lie in 0 .. 65535";
  in_addr address{};
  if (inet_pton(AF_INET, bind.c_str(), &address) != 1) return "bind address '" + bind + "' is not an IPv4 address";
  if (max_message_bytes <= 0 || best_effort_queue_bytes <= 0 || reliable_queue_bytes <= 0)
    return "sizes must be positive";
  if (backpressure_timeout_ms < 0) return "backpressure_timeout_ms must not be negative";
  return "";
}

struct Hub::Impl {
  HubOptions options;
  int listener = -1, epoll = -1, port = 0;
  std::map<int, std::unique_ptr<HubClient>> clients;  // by descriptor
  Statistics statistics;
  bool any_paused = false;

  ~Impl() {
    clients.clear();
    if (listener >= 0) close(listener);
    if (epoll >= 0) close(epoll);
  }

  void Watch(HubClient* client) {
    const uint32_t events = (client->paused ? 0u : static_cast<uint32_t>(EPOLLIN)) |
                            (client->has_output() ? static_cast<uint32_t>(EPOLLOUT) : 0u);
    if (events == client->events) return;
    epoll_event event{};
    event.events = events;
    event.data.fd = client->fd();
    epoll_ctl(epoll, EPOLL_CTL_MOD, client->fd(), &event);
    client->events = events;
  }

  void Accept() {
    for (;;) {
      const int fd = accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
      if (fd < 0) return;
      auto client = std::make_unique<HubClient>(fd, options.max_message_bytes);
      epoll_event event{};
      event.events = EPOLLIN | EPOLLOUT;
      event.data.fd = fd;
      client->events = event.events;
      if (epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event) == 0) clients[fd] = std::move(client);
    }
  }

  void Remove(int fd) {
    const auto it = clients.find(fd);
    if (it->second->misbehaved()) {
      ++statistics.num_refused_clients;
      spdlog::warn("hub: disconnected a client that does not speak LCM's TCP protocol");
    }
    clients.erase(it);  // closing the descriptor takes it out of epoll
  }

  // Gives the message to everybody who wants it. The publisher is paused if one of them has too much waiting.
  void Route(HubClient* publisher, std::string_view channel_view, const std::shared_ptr<const HubFrame>& frame) {
    ++statistics.num_messages;
    const std::string channel(channel_view);
    for (auto& [fd, client] : clients) {
      if (!client->Wants(channel)) continue;
      if (!frame->best_effort && client->stalled) {
        ++statistics.num_dropped_reliable;
        continue;
      }
      client->Enqueue(frame);
      if (frame->best_effort) {
        statistics.num_dropped += client->DropOldestBestEffort(options.best_effort_queue_bytes);
      } else if (client->reliable_bytes() > options.reliable_queue_bytes) {
        // Sockets may just have room that epoll has not told of yet.
        client->Write();
        if (client->reliable_bytes() > options.reliable_queue_bytes) publisher->paused = any_paused = true;
      }
    }
  }

  void MarkStalled() {
    const auto now = std::chrono::steady_clock::now();
    for (auto& [fd, client] : clients) {
      if (client->reliable_bytes() <= options.reliable_queue_bytes || client->stalled) continue;
      if (now - client->last_write < std::chrono::milliseconds(options.backpressure_timeout_ms)) continue;
      client->stalled = true;
      spdlog::warn("hub: a subscriber has not read for {} ms with {} MB waiting; it misses messages from now on",
                   options.backpressure_timeout_ms, client->reliable_bytes() >> 20);
    }
  }

  // Lets publishers go on once no subscriber that counts is full.
  void Resume() {
    bool full = false;
    for (auto& [fd, client] : clients) {
      if (client->stalled && client->reliable_bytes() <= options.reliable_queue_bytes / 2) client->stalled = false;
      full = full || (!client->stalled && client->reliable_bytes() > options.reliable_queue_bytes);
    }
    if (full) return;
    for (auto& [fd, client] : clients) client->paused = false;
    any_paused = false;
  }
};

Hub::Hub(const HubOptions& options) : impl_(std::make_unique<Impl>()) {
  if (const std::string error = options.Check(); !error.empty()) throw std::runtime_error(error);
  impl_->options = options;
  const auto fail = [&](const char* what) {
    throw std::runtime_error(std::string(what) + " " + options.bind + ":" + std::to_string(options.port) + ": " +
                             std::strerror(errno));
  };
  impl_->listener = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (impl_->listener < 0) fail("cannot make a socket for");
  const int one = 1;
  setsockopt(impl_->listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(options.port));
  inet_pton(AF_INET, options.bind.c_str(), &address.sin_addr);
  if (::bind(impl_->listener, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0 ||
      listen(impl_->listener, 64) != 0) {
    fail("cannot listen on");
  }
  socklen_t length = sizeof(address);
  getsockname(impl_->listener, reinterpret_cast<sockaddr*>(&address), &length);
  impl_->port = ntohs(address.sin_port);
  impl_->epoll = epoll_create1(EPOLL_CLOEXEC);
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.fd = impl_->listener;
  if (impl_->epoll < 0 || epoll_ctl(impl_->epoll, EPOLL_CTL_ADD, impl_->listener, &event) != 0) fail("cannot watch");
}

Hub::~Hub() = default;

int Hub::Port() const { return impl_->port; }

void Hub::Spin(int timeout_ms) {
  epoll_event events[64];
  const int n = epoll_wait(impl_->epoll, events, 64, impl_->any_paused ? std::min(timeout_ms, 50) : timeout_ms);
  for (int i = 0; i < n; ++i) {
    const int fd = events[i].data.fd;
    if (fd == impl_->listener) {
      impl_->Accept();
      continue;
    }
    const auto it = impl_->clients.find(fd);
    if (it == impl_->clients.end()) continue;
    HubClient* client = it->second.get();
    bool alive = true;
    if (events[i].events & EPOLLOUT) alive = client->Write();
    if (alive && (events[i].events & (EPOLLIN | EPOLLHUP | EPOLLERR))) {
      alive = client->Read([&](std::string_view channel, std::shared_ptr<const HubFrame> frame) {
        impl_->Route(client, channel, frame);
      });
    }
    if (!alive) impl_->Remove(fd);
  }
  if (impl_->any_paused) {
    impl_->MarkStalled();
    impl_->Resume();
  }
  for (auto& [fd, client] : impl_->clients) {
    if (client->has_output()) client->Write();  // an error shows as EPOLLHUP
    impl_->Watch(client.get());
  }
}

Hub::Statistics Hub::GetStatistics() const {
  Statistics statistics = impl_->statistics;
  statistics.num_clients = static_cast<int>(impl_->clients.size());
  for (const auto& [fd, client] : impl_->clients)
    statistics.queued_bytes += client->reliable_bytes() + client->best_effort_bytes();
  return statistics;
}

}  // namespace mapmend
