#pragma once

// Templates of bus.h. Not to be included by itself.
#include <optional>
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

// What bytes from the bus say, or one line why they are not believed.
template <typename Message>
struct Decoded {
  std::optional<Message> value;
  std::string error;  // if there is no value
};

// To and from the wire form, for every type that is published, subscribed to or asked for. Here: types made by lcm-gen.
// Plain types have specialisations, declared beside them or in a codec of libs/wire; of those, Decode also checks that
// the values can be. Decode never throws for bad bytes.
template <typename Message>
std::vector<uint8_t> Encode(const Message& message) {
  return EncodeMessage(message);
}
template <typename Message>
Decoded<Message> Decode(const uint8_t* data, int size) {
  Message message{};
  if (!DecodeMessage(data, size, &message)) return {std::nullopt, std::string("not a ") + Message::getTypeName()};
  return {std::move(message), ""};
}
template <typename Message>
Decoded<Message> Decode(const std::vector<uint8_t>& data) {
  return Decode<Message>(data.data(), static_cast<int>(data.size()));
}

template <typename Message>
Subscription Bus::Subscribe(const std::string& channel, Delivery delivery,
                            std::function<void(const Message&)> handler) {
  return SubscribeRaw(channel, delivery, [this, channel, handler = std::move(handler)](const uint8_t* data, int size) {
    const Decoded<Message> message = Decode<Message>(data, size);
    if (!message.value) {
      CountRefused(channel, message.error);
      return;
    }
    handler(*message.value);
  });
}

template <typename Message>
bool Bus::Publish(const std::string& channel, const Message& message) {
  const std::vector<uint8_t> data = Encode(message);
  return PublishRaw(channel, data.data(), static_cast<int>(data.size()));
}

}  // namespace mapmend
