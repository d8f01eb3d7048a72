#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

namespace mapmend {

// Whether a subscription may lose messages: kKeepAll queues without limit (stream, acks, requests), kLatest keeps the
// newest few (images, live poses).
enum class Delivery { kKeepAll, kLatest };

using RawHandler = std::function<void(const uint8_t* data, int size)>;

// One handler of one channel, shared by the bus that calls it and the Subscription that ends it.
class Subscriber : public std::enable_shared_from_this<Subscriber> {
 public:
  using OnRefused = std::function<void(const std::string& what)>;
  //   channel  with its prefix
  //   refused  told of exceptions that leave the handler
  Subscriber(std::string channel, Delivery delivery, RawHandler handler, OnRefused refused);

  void Call(const uint8_t* data, int size);
  // After this the handler is not called any more; one that is running in another thread has returned.
  void End();

  const std::string& channel() const { return channel_; }
  Delivery delivery() const { return delivery_; }

 private:
  const std::string channel_;
  const Delivery delivery_;
  const RawHandler handler_;
  const OnRefused refused_;
  std::recursive_mutex mutex_;  // a handler may end its own subscription
  bool active_ = true;
};

class Transport;

// Holds a handler on the bus for as long as it lives. May outlive the bus. A handler must not wait for a lock that the
// thread holds which ends the subscription.
class [[nodiscard]] Subscription {
 public:
  Subscription() = default;
  Subscription(std::shared_ptr<Subscriber> subscriber, std::weak_ptr<Transport> transport);
  ~Subscription();
  Subscription(Subscription&& other) noexcept = default;
  Subscription& operator=(Subscription&& other) noexcept;
  void Reset();

 private:
  std::shared_ptr<Subscriber> subscriber_;
  std::weak_ptr<Transport> transport_;
};

}  // namespace mapmend
