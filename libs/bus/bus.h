#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "libs/bus/subscription.h"

namespace mapmend {

// The URL to use: the argument if not empty, else LCM_DEFAULT_URL, else tcpq://127.0.0.1:7700.
std::string ResolveLcmUrl(const std::string& argument);

// The one way onto LCM's channels: tcpq by a link of our own, all else by liblcm. One thread calls Handle; Publish may
// be called from any thread. Survives the hub's absence and restart. Untrusted input: a message whose lengths do not
// fit its bytes is counted and dropped before it reaches a handler.
class Bus {
 public:
  // url as ResolveLcmUrl gives. The hub is told the token in the environment variable MAPMEND_TOKEN, if there is one.
  // Throws std::runtime_error with one line if the URL is malformed or udpm has no route.
  Bus(const std::string& url, const std::string& channel_prefix);
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  // Handlers run inside Handle, on its thread, as long as the result lives. Exceptions that leave a handler are caught,
  // counted and reported.
  template <typename Message>
  Subscription Subscribe(const std::string& channel, Delivery delivery, std::function<void(const Message&)> handler);
  Subscription SubscribeRaw(const std::string& channel, Delivery delivery, RawHandler handler);

  // Never waits. True: on its way, as far as we know. False: no hub, or too much is on its way already.
  template <typename Message>
  bool Publish(const std::string& channel, const Message& message);
  bool PublishRaw(const std::string& channel, const uint8_t* data, int size);

  // Waits up to timeout_ms for messages and dispatches all that are ready. Returns the number dispatched.
  int Handle(int timeout_ms);

  bool IsConnected() const;
  int64_t ConnectionNumber() const;  // grows with each new connection: what was sent over an older one may be lost
  int64_t NumRefused() const;        // messages that did not decode or whose handler threw

 private:
  void CountRefused(const std::string& channel, const std::string& what);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend

#include "libs/bus/bus_impl.h"  // the templates
