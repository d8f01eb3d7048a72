#include "libs/bus/bus.h"

#include <lcm/lcm.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <stdexcept>
#include <thread>

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kUdpReceiveBuffer = 4194304;  // bytes; messages above 100 KB are lost with less (docs/protocol.md)
constexpr int kSocketTimeoutS = 10;         // longer than the hub's back-pressure time-out
// Between attempts to connect: quick at first, so that a restarted hub is found at once, then slower.
constexpr auto kFirstReconnectInterval = std::chrono::milliseconds(100),
               kReconnectInterval = std::chrono::milliseconds(500);
constexpr int kNumFirstReconnects = 20;
constexpr int kMaxMessagesPerHandle = 512;  // so that heartbeats go on under load

// Bounds how long a hung hub can hold us, and keeps small messages from waiting for each other's acknowledgement.
void ConfigureSocket(int fd) {
  const timeval timeout = {kSocketTimeoutS, 0};
  const int one = 1;
  setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &timeout, sizeof(timeout));
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof(timeout));
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof(one));
}

struct LcmDeleter {
  void operator()(lcm_t* lcm) const { lcm_destroy(lcm); }
};
using LcmPtr = std::unique_ptr<lcm_t, LcmDeleter>;

bool IsChannelText(const std::string& text) {
  return std::all_of(text.begin(), text.end(),
                     [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; });
}

std::string CheckedUrl(std::string url) {
  const size_t colon = url.find("://");
  const std::string scheme = url.substr(0, colon);
  if (colon == std::string::npos || (scheme != "tcpq" && scheme != "udpm" && scheme != "memq" && scheme != "file")) {
    throw std::runtime_error("LCM URL '" + url +
                             "': expected tcpq://HOST:PORT, udpm://GROUP:PORT?ttl=0, memq:// or file://LOG");
  }
  if (scheme == "udpm" && url.find("recv_buf_size") == std::string::npos) {
    url.push_back(url.find('?') == std::string::npos ? '?' : '&');
    url.append("recv_buf_size=").append(std::to_string(kUdpReceiveBuffer));
  }
  return url;
}

void WarnIfUdpBufferIsSmall() {
  int granted = 0;
  std::ifstream("/proc/sys/net/core/rmem_max") >> granted;
  if (granted > 0 && granted < kUdpReceiveBuffer) {
    spdlog::warn(
        "udpm: the kernel grants receive buffers of {} bytes only, large messages will be lost; run 'sysctl -w "
        "net.core.rmem_max={}' or use tcpq",
        granted, kUdpReceiveBuffer);
  }
}

}  // namespace

std::string ResolveLcmUrl(const std::string& argument) {
  if (!argument.empty()) return argument;
  const char* environment = std::getenv("LCM_DEFAULT_URL");
  return environment != nullptr && *environment != '\0' ? environment : "tcpq://127.0.0.1:7700";
}

// For tcpq there are two connections, one that only publishes and one that only receives: a process that waits in
// publish (back-pressure) can then still be read from by another thread, and a reconnection in one thread cannot close
// the descriptor that the other one writes to.
struct Bus::Impl {
  struct Subscriber {
    Bus* bus;
    std::string channel;  // without prefix
    RawHandler handler;
  };

  std::string prefix;
  bool is_tcp = false;
  LcmPtr receiver, publisher;  // publisher is null if the receiver publishes too
  std::vector<std::unique_ptr<Subscriber>> subscribers;
  std::mutex publish_mutex;
  // When to connect again, and how often it failed in a row.
  struct Reconnection {
    Clock::time_point next;
    int num_failed = 0;

    bool IsDue() {
      const auto now = Clock::now();
      if (now < next) return false;
      next = now + (num_failed < kNumFirstReconnects ? kFirstReconnectInterval : kReconnectInterval);
      return true;
    }
    void Tell(int fd) {
      num_failed = fd >= 0 ? 0 : num_failed + 1;
      if (fd >= 0) ConfigureSocket(fd);
    }
  };
  Reconnection publisher_reconnection, receiver_reconnection;
  std::atomic<bool> connected{false};
  std::atomic<int64_t> num_refused{0};

  static void Dispatch(const lcm_recv_buf_t* buffer, const char*, void* user) {
    auto* subscriber = static_cast<Subscriber*>(user);
    // An exception must not cross liblcm's frames: it would assert in the next handle.
    try {
      subscriber->handler(static_cast<const uint8_t*>(buffer->data), static_cast<int>(buffer->data_size));
    } catch (const std::exception& e) {
      subscriber->bus->CountRefused(subscriber->channel, e.what());
    } catch (...) {
      subscriber->bus->CountRefused(subscriber->channel, "unknown exception");
    }
  }

  // liblcm reconnects and subscribes again only when it publishes.
  void ReconnectReceiver() {
    if (!receiver_reconnection.IsDue()) return;
    const uint8_t ping = 0;
    lcm_publish(receiver.get(), (prefix + "MAPMEND_PING").c_str(), &ping, 1);
    receiver_reconnection.Tell(lcm_get_fileno(receiver.get()));
  }
};

Bus::Bus(const std::string& url, const std::string& channel_prefix) : impl_(std::make_unique<Impl>()) {
  if (!IsChannelText(channel_prefix) || channel_prefix.size() > 32) {
    throw std::runtime_error("channel prefix '" + channel_prefix + "': only letters, digits and _, at most 32");
  }
  std::signal(SIGPIPE, SIG_IGN);
  const std::string checked = CheckedUrl(url);
  impl_->prefix = channel_prefix;
  impl_->is_tcp = checked.starts_with("tcpq");
  impl_->receiver.reset(lcm_create(checked.c_str()));
  if (!impl_->receiver) {
    throw std::runtime_error(
        "LCM URL '" + checked + "' cannot be used" +
        (checked.starts_with("udpm") ? "; is there a multicast route ('ip route add 224.0.0.0/4 dev lo')?" : ""));
  }
  if (impl_->is_tcp) {
    impl_->publisher.reset(lcm_create(checked.c_str()));
    for (lcm_t* lcm : {impl_->receiver.get(), impl_->publisher.get()}) {
      const int fd = lcm == nullptr ? -1 : lcm_get_fileno(lcm);
      if (fd >= 0) ConfigureSocket(fd);
    }
  }
  if (checked.starts_with("udpm")) WarnIfUdpBufferIsSmall();
  impl_->connected = !impl_->is_tcp || lcm_get_fileno(impl_->receiver.get()) >= 0;
}

Bus::~Bus() = default;

void Bus::SubscribeRaw(const std::string& channel, Delivery delivery, RawHandler handler) {
  impl_->subscribers.push_back(std::make_unique<Impl::Subscriber>(Impl::Subscriber{this, channel, std::move(handler)}));
  lcm_subscription_t* subscription = lcm_subscribe(impl_->receiver.get(), (impl_->prefix + channel).c_str(),
                                                   &Impl::Dispatch, impl_->subscribers.back().get());
  if (subscription == nullptr) throw std::runtime_error("cannot subscribe to " + impl_->prefix + channel);
  lcm_subscription_set_queue_capacity(subscription, delivery == Delivery::kKeepAll ? 0 : 2);
}

bool Bus::PublishRaw(const std::string& channel, const uint8_t* data, int size) {
  const std::lock_guard<std::mutex> lock(impl_->publish_mutex);
  lcm_t* lcm = impl_->publisher ? impl_->publisher.get() : impl_->receiver.get();
  const std::string name = impl_->prefix + channel;
  if (!impl_->is_tcp) return lcm_publish(lcm, name.c_str(), data, static_cast<unsigned>(size)) == 0;
  const bool was_connected = lcm_get_fileno(lcm) >= 0;
  if (!was_connected && !impl_->publisher_reconnection.IsDue()) return false;
  const bool sent = lcm_publish(lcm, name.c_str(), data, static_cast<unsigned>(size)) == 0;
  if (!was_connected) impl_->publisher_reconnection.Tell(lcm_get_fileno(lcm));
  return sent;
}

int Bus::Handle(int timeout_ms) {
  const auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
  const auto remaining_ms = [&] {
    return std::max<int64_t>(0, std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count());
  };
  int num_handled = 0;
  while (num_handled < kMaxMessagesPerHandle) {
    int fd = lcm_get_fileno(impl_->receiver.get());
    if (fd < 0) {
      impl_->connected = false;
      impl_->ReconnectReceiver();
      fd = lcm_get_fileno(impl_->receiver.get());
      if (fd < 0) {
        const int64_t wait = std::min<int64_t>(20, remaining_ms());
        if (wait == 0 || num_handled > 0) return num_handled;
        std::this_thread::sleep_for(std::chrono::milliseconds(wait));
        continue;
      }
    }
    impl_->connected = true;
    pollfd descriptor = {fd, POLLIN, 0};
    if (poll(&descriptor, 1, num_handled > 0 ? 0 : static_cast<int>(remaining_ms())) <= 0) return num_handled;
    if (lcm_handle(impl_->receiver.get()) == 0) {
      ++num_handled;
    } else if (!impl_->is_tcp) {
      return num_handled;  // the end of a log file
    }
  }
  return num_handled;
}

bool Bus::IsConnected() const { return impl_->connected; }

int64_t Bus::NumRefused() const { return impl_->num_refused; }

void Bus::CountRefused(const std::string& channel, const std::string& what) {
  const int64_t count = ++impl_->num_refused;
  if (count <= 10 || count % 1000 == 0) spdlog::warn("{}: message refused ({} in all): {}", channel, count, what);
}

}  // namespace mapmend
