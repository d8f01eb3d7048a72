#pragma once

// Templates of bus.h. Not to be included by itself.
#include <stdexcept>
#include <utility>

#include "libs/bus/bus.h"

namespace mapmend {

// The wire form of a message made by lcm-gen. Its counts must agree with its arrays; that is the caller's business.
template <typename Message>
std::vector<uint8_t> EncodeMessage(const Message& message) {
  std::vector<uint8_t> data(static_cast<size_t>(message.getEncodedSize()));
  const int size = message.encode(data.data(), 0, static_cast<int>(data.size()));
  if (size < 0) throw std::invalid_argument(std::string(Message::getTypeName()) + ": cannot be encoded");
  data.resize(static_cast<size_t>(size));
  return data;
}

// False if the bytes are not exactly one message of this type. Never allocates more than a small multiple of size.
template <typename Message>
bool DecodeMessage(const uint8_t* data, int size, Message* message) {
  try {
    return message->decode(data, 0, size) == size;
  } catch (const std::exception&) {  // a string of negative length
    return false;
  }
}

template <typename Message>
Subscription Bus::Subscribe(const std::string& channel, Delivery delivery,
                            std::function<void(const Message&)> handler) {
  return SubscribeRaw(channel, delivery, [this, channel, handler = std::move(handler)](const uint8_t* data, int size) {
    Message message{};
    if (!DecodeMessage(data, size, &message)) {
      CountRefused(channel, std::string("not a ") + Message::getTypeName());
      return;
    }
    handler(message);
  });
}

template <typename Message>
bool Bus::Publish(const std::string& channel, const Message& message) {
  const std::vector<uint8_t> data = EncodeMessage(message);
  return PublishRaw(channel, data.data(), static_cast<int>(data.size()));
}

}  // namespace mapmend
