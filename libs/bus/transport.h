#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "libs/bus/subscription.h"

namespace mapmend {

// What carries the messages of a Bus (bus.h says what is expected of it). Channels come with their prefix.
class Transport {
 public:
  virtual ~Transport() = default;
  virtual void Add(std::shared_ptr<Subscriber> subscriber) = 0;
  virtual void Remove(const Subscriber* subscriber) = 0;
  virtual bool Publish(const std::string& channel, const uint8_t* data, int size) = 0;
  virtual int Handle(int timeout_ms) = 0;
  virtual bool IsConnected() const = 0;
  virtual int64_t ConnectionNumber() const { return 0; }
};

constexpr int kMaxMessagesPerHandle = 512;  // so that heartbeats go on under load

}  // namespace mapmend
