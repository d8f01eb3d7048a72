#pragma once

#include <cstdint>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/stream/store_questions.h"

// What the store is asked and answers, to and from its wire form. Decode refuses bytes that are no such message, a
// status that does not exist, and records whose lengths do not fit; whether a question makes sense is for the store to
// say.
namespace mapmend {

// MAPMEND_BOW_QUERY, MAPMEND_BOW_RESULT
template <>
std::vector<uint8_t> Encode(const BowQuery& query);
template <>
Decoded<BowQuery> Decode(const uint8_t* data, int size);
template <>
std::vector<uint8_t> Encode(const BowAnswer& answer);
template <>
Decoded<BowAnswer> Decode(const uint8_t* data, int size);

// MAPMEND_FETCH, MAPMEND_FETCHED
template <>
std::vector<uint8_t> Encode(const FetchRequest& request);
template <>
Decoded<FetchRequest> Decode(const uint8_t* data, int size);
template <>
std::vector<uint8_t> Encode(const FetchAnswer& answer);
template <>
Decoded<FetchAnswer> Decode(const uint8_t* data, int size);

// MAPMEND_PROGRESS_REQUEST, MAPMEND_PROGRESS
template <>
std::vector<uint8_t> Encode(const ProgressRequest& request);
template <>
Decoded<ProgressRequest> Decode(const uint8_t* data, int size);
template <>
std::vector<uint8_t> Encode(const SessionProgress& progress);
template <>
Decoded<SessionProgress> Decode(const uint8_t* data, int size);

// MAPMEND_CLOSE_SESSION, MAPMEND_SESSION_CLOSED
template <>
std::vector<uint8_t> Encode(const CloseRequest& request);
template <>
Decoded<CloseRequest> Decode(const uint8_t* data, int size);
template <>
std::vector<uint8_t> Encode(const CloseAnswer& answer);
template <>
Decoded<CloseAnswer> Decode(const uint8_t* data, int size);

// MAPMEND_EDGE_REQUEST, MAPMEND_EDGE_DECISIONS
template <>
std::vector<uint8_t> Encode(const EdgeRequest& request);
template <>
Decoded<EdgeRequest> Decode(const uint8_t* data, int size);
template <>
std::vector<uint8_t> Encode(const EdgeAnswer& answer);
template <>
Decoded<EdgeAnswer> Decode(const uint8_t* data, int size);

// MAPMEND_REVISION_FETCH, MAPMEND_REVISION_FETCHED, MAPMEND_REVISION_ACK
template <>
std::vector<uint8_t> Encode(const RevisionRequest& request);
template <>
Decoded<RevisionRequest> Decode(const uint8_t* data, int size);
template <>
std::vector<uint8_t> Encode(const RevisionAnswer& answer);
template <>
Decoded<RevisionAnswer> Decode(const uint8_t* data, int size);
template <>
std::vector<uint8_t> Encode(const RevisionAck& ack);
template <>
Decoded<RevisionAck> Decode(const uint8_t* data, int size);

}  // namespace mapmend
