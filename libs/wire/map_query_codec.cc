// The questions of query_codec.h that are about the merged map: people's decisions on connections, revisions.

#include <mapmend/edge_decisions_t.hpp>
#include <mapmend/edge_request_t.hpp>
#include <mapmend/revision_ack_t.hpp>
#include <mapmend/revision_fetch_t.hpp>
#include <mapmend/revision_fetched_t.hpp>

#include "libs/wire/addressed.h"
#include "libs/wire/query_codec.h"

namespace mapmend {
namespace {

using wire::AddressedAs;
using wire::Addressing;
using wire::Count;
using wire::ReadStatus;

// The statuses of an answer have the same numbers here and there.
static_assert(static_cast<int>(RevisionAnswer::Status::kNone) == revision_fetched_t::NONE);

std::vector<edge_decision_t> ToMessages(const std::vector<EdgeDecision>& decisions) {
  std::vector<edge_decision_t> messages;
  for (const EdgeDecision& d : decisions) {
    edge_decision_t message{};
    message.session_a = d.a.session;
    message.submap_a = d.a.submap.value;
    message.session_b = d.b.session;
    message.submap_b = d.b.submap.value;
    message.disabled = d.disabled ? 1 : 0;
    messages.push_back(message);
  }
  return messages;
}

std::vector<EdgeDecision> Read(const std::vector<edge_decision_t>& messages) {
  std::vector<EdgeDecision> decisions;
  for (const edge_decision_t& m : messages)
    decisions.push_back({{m.session_a, SubmapId(m.submap_a)}, {m.session_b, SubmapId(m.submap_b)}, m.disabled != 0});
  return decisions;
}

edge_request_t ToMessage(const EdgeRequest& request) {
  auto message = Addressing<edge_request_t>(request);
  message.decisions = ToMessages(request.decisions);
  message.num_decisions = Count(message.decisions);
  return message;
}

EdgeRequest Read(const edge_request_t& m) {
  auto request = AddressedAs<EdgeRequest>(m);
  request.decisions = Read(m.decisions);
  return request;
}

edge_decisions_t ToMessage(const EdgeAnswer& answer) {
  auto message = Addressing<edge_decisions_t>(answer);
  message.decisions = ToMessages(answer.decisions);
  message.num_decisions = Count(message.decisions);
  return message;
}

EdgeAnswer Read(const edge_decisions_t& m) {
  auto answer = AddressedAs<EdgeAnswer>(m);
  answer.decisions = Read(m.decisions);
  return answer;
}

revision_fetch_t ToMessage(const RevisionRequest& request) {
  auto message = Addressing<revision_fetch_t>(request);
  message.revision = request.revision;
  message.part = request.part;
  return message;
}

RevisionRequest Read(const revision_fetch_t& m) {
  auto request = AddressedAs<RevisionRequest>(m);
  request.revision = m.revision;
  request.part = m.part;
  return request;
}

revision_fetched_t ToMessage(const RevisionAnswer& answer) {
  auto message = Addressing<revision_fetched_t>(answer);
  message.status = static_cast<int8_t>(answer.status);
  message.revision = answer.revision;
  message.part = answer.part;
  message.num_parts = answer.num_parts;
  message.data = answer.data;
  message.num_bytes = Count(message.data);
  return message;
}

RevisionAnswer Read(const revision_fetched_t& m) {
  auto answer = AddressedAs<RevisionAnswer>(m);
  answer.status = ReadStatus(m.status, RevisionAnswer::Status::kNone);
  answer.revision = m.revision;
  answer.part = m.part;
  answer.num_parts = m.num_parts;
  answer.data = m.data;
  return answer;
}

revision_ack_t ToMessage(const RevisionAck& ack) {
  revision_ack_t message{};
  message.revision = ack.revision;
  message.part = ack.part;
  return message;
}

RevisionAck Read(const revision_ack_t& m) { return {m.revision, m.part}; }

}  // namespace

template <>
std::vector<uint8_t> Encode(const EdgeRequest& request) {
  return EncodeMessage(ToMessage(request));
}

template <>
Decoded<EdgeRequest> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<EdgeRequest, edge_request_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const EdgeAnswer& answer) {
  return EncodeMessage(ToMessage(answer));
}

template <>
Decoded<EdgeAnswer> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<EdgeAnswer, edge_decisions_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const RevisionRequest& request) {
  return EncodeMessage(ToMessage(request));
}

template <>
Decoded<RevisionRequest> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<RevisionRequest, revision_fetch_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const RevisionAnswer& answer) {
  return EncodeMessage(ToMessage(answer));
}

template <>
Decoded<RevisionAnswer> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<RevisionAnswer, revision_fetched_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const RevisionAck& ack) {
  return EncodeMessage(ToMessage(ack));
}

template <>
Decoded<RevisionAck> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<RevisionAck, revision_ack_t>(data, size, Read);
}

}  // namespace mapmend
