#pragma once

#include <cstdint>

#include "libs/stream/store_questions.h"
#include "libs/wire/checked.h"

// What questions to the store, and answers, have in common. For codecs.
namespace mapmend::wire {

// Throws (as Require does) unless the number is one of an enum that counts from 0 to last.
template <typename Status>
Status ReadStatus(int8_t number, Status last) {
  Require(number >= 0 && number <= static_cast<int>(last), "status is unknown");
  return static_cast<Status>(number);
}

// A message for, or to, the one who asks.
template <typename Message>
Message Addressing(const Addressed& addressed) {
  Message message{};
  message.id = addressed.id;
  message.requester = addressed.requester;
  return message;
}

template <typename Value, typename Message>
Value AddressedAs(const Message& message) {
  Value value;
  value.id = message.id;
  value.requester = message.requester;
  return value;
}

// Of a value that names a session.
template <typename Message, typename Request>
Message AboutSession(const Request& request) {
  auto message = Addressing<Message>(request);
  message.session = request.session;
  return message;
}

}  // namespace mapmend::wire
