#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace mapmend {

// Whether a subscription may lose messages: kKeepAll queues without limit (stream, acks, requests), kLatest keeps the
// newest few (images, live poses).
enum class Delivery { kKeepAll, kLatest };

// The URL to use: the argument if not empty, else LCM_DEFAULT_URL, else tcpq://127.0.0.1:7700.
std::string ResolveLcmUrl(const std::string& argument);

// The one wrapper of LCM. One thread calls Handle; Publish may be called from any thread (tcpq is not thread-safe by
// itself). Survives the hub's absence and restart: Handle reconnects. Untrusted input: a message whose lengths do not
// fit its bytes is counted and dropped before it reaches a handler.
class Bus {
 public:
  // url as ResolveLcmUrl gives. Throws std::runtime_error with one line if the URL is malformed or udpm has no route.
  Bus(const std::string& url, const std::string& channel_prefix);
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  // Handlers run inside Handle, on its thread. Exceptions that leave a handler are caught, counted and reported.
  template <typename Message>
  void Subscribe(const std::string& channel, Delivery delivery, std::function<void(const Message&)> handler);
  using RawHandler = std::function<void(const uint8_t* data, int size)>;
  void SubscribeRaw(const std::string& channel, Delivery delivery, RawHandler handler);

  // False if nothing could be sent (no hub); never blocks for longer than the hub's back-pressure time-out.
  template <typename Message>
  bool Publish(const std::string& channel, const Message& message);
  bool PublishRaw(const std::string& channel, const uint8_t* data, int size);

  // Waits up to timeout_ms for messages and dispatches all that are ready. Returns the number dispatched.
  int Handle(int timeout_ms);

  bool IsConnected() const;
  int64_t NumRefused() const;  // messages that did not decode or whose handler threw

 private:
  void CountRefused(const std::string& channel, const std::string& what);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend

#include "libs/bus/bus_impl.h"  // the templates
