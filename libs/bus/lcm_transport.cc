#include "libs/bus/lcm_transport.h"

#include <poll.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <stdexcept>

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kUdpReceiveBuffer = 4194304;  // bytes; messages above 100 KB are lost with less (docs/protocol.md)

std::string WithReceiveBuffer(std::string url) {
  if (!url.starts_with("udpm") || url.find("recv_buf_size") != std::string::npos) return url;
  url.push_back(url.find('?') == std::string::npos ? '?' : '&');
  return url.append("recv_buf_size=").append(std::to_string(kUdpReceiveBuffer));
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

LcmTransport::LcmTransport(const std::string& url) : lcm_(lcm_create(WithReceiveBuffer(url).c_str())) {
  if (lcm_ == nullptr) {
    throw std::runtime_error(
        "LCM URL '" + url + "' cannot be used" +
        (url.starts_with("udpm") ? "; is there a multicast route ('ip route add 224.0.0.0/4 dev lo')?" : ""));
  }
  if (url.starts_with("udpm")) WarnIfUdpBufferIsSmall();
}

LcmTransport::~LcmTransport() { lcm_destroy(lcm_); }

void LcmTransport::Dispatch(const lcm_recv_buf_t* buffer, const char*, void* user) {
  // Shared: the handler may end its own subscription.
  const auto subscriber = static_cast<Subscriber*>(user)->shared_from_this();
  subscriber->Call(static_cast<const uint8_t*>(buffer->data), static_cast<int>(buffer->data_size));
}

void LcmTransport::Add(std::shared_ptr<Subscriber> subscriber) {
  const std::lock_guard lock(mutex_);
  lcm_subscription_t* subscription =
      lcm_subscribe(lcm_, subscriber->channel().c_str(), &LcmTransport::Dispatch, subscriber.get());
  if (subscription == nullptr) throw std::runtime_error("cannot subscribe to " + subscriber->channel());
  lcm_subscription_set_queue_capacity(subscription, subscriber->delivery() == Delivery::kKeepAll ? 0 : 2);
  const Subscriber* key = subscriber.get();
  entries_[key] = {std::move(subscriber), subscription};
}

void LcmTransport::Remove(const Subscriber* subscriber) {
  const std::lock_guard lock(mutex_);
  const auto it = entries_.find(subscriber);
  if (it == entries_.end()) return;
  lcm_unsubscribe(lcm_, it->second.subscription);
  entries_.erase(it);
}

bool LcmTransport::Publish(const std::string& channel, const uint8_t* data, int size) {
  const std::lock_guard lock(publish_mutex_);
  return lcm_publish(lcm_, channel.c_str(), data, static_cast<unsigned>(size)) == 0;
}

int LcmTransport::Handle(int timeout_ms) {
  const auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
  int num_handled = 0;
  while (num_handled < kMaxMessagesPerHandle) {
    const auto remaining = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
    pollfd descriptor = {lcm_get_fileno(lcm_), POLLIN, 0};
    const int wait_ms = num_handled > 0 ? 0 : static_cast<int>(std::max<int64_t>(0, remaining));
    if (poll(&descriptor, 1, wait_ms) <= 0) return num_handled;
    if (lcm_handle(lcm_) != 0) return num_handled;  // the end of a log file
    ++num_handled;
  }
  return num_handled;
}

}  // namespace mapmend
