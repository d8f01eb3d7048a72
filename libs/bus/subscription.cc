#include "libs/bus/subscription.h"

#include <exception>
#include <utility>

#include "libs/bus/transport.h"

namespace mapmend {

Subscriber::Subscriber(std::string channel, Delivery delivery, RawHandler handler, OnRefused refused)
    : channel_(std::move(channel)), delivery_(delivery), handler_(std::move(handler)), refused_(std::move(refused)) {}

void Subscriber::Call(const uint8_t* data, int size) {
  const std::lock_guard lock(mutex_);
  if (!active_) return;
  try {
    handler_(data, size);
  } catch (const std::exception& e) {
    refused_(e.what());
  } catch (...) {
    refused_("unknown exception");
  }
}

void Subscriber::End() {
  const std::lock_guard lock(mutex_);
  active_ = false;
}

Subscription::Subscription(std::shared_ptr<Subscriber> subscriber, std::weak_ptr<Transport> transport)
    : subscriber_(std::move(subscriber)), transport_(std::move(transport)) {}

Subscription::~Subscription() { Reset(); }

Subscription& Subscription::operator=(Subscription&& other) noexcept {
  if (this == &other) return *this;
  Reset();
  subscriber_ = std::move(other.subscriber_);
  transport_ = std::move(other.transport_);
  return *this;
}

void Subscription::Reset() {
  if (!subscriber_) return;
  subscriber_->End();
  if (const auto transport = transport_.lock()) transport->Remove(subscriber_.get());
  subscriber_.reset();
}

}  // namespace mapmend
