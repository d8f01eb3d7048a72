#pragma once

#include <cstdint>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/positioning/position_fix.h"
#include "libs/stream/stream_messages.h"

// What is said of the stream beside its records, to and from its wire form.
namespace mapmend {

// MAPMEND_STREAM_STATE. Whether the numbers can be is for the store to say (SessionLog).
template <>
std::vector<uint8_t> Encode(const StreamState& state);
template <>
Decoded<StreamState> Decode(const uint8_t* data, int size);

// MAPMEND_ACK
template <>
std::vector<uint8_t> Encode(const StreamAck& ack);
template <>
Decoded<StreamAck> Decode(const uint8_t* data, int size);

// MAPMEND_STORE_STARTED
template <>
std::vector<uint8_t> Encode(const StoreStarted& started);
template <>
Decoded<StoreStarted> Decode(const uint8_t* data, int size);

// MAPMEND_CHECKSUM. Refused: what is no session's name, and numbers that no record can have.
template <>
std::vector<uint8_t> Encode(const RecordChecksumList& checksums);
template <>
Decoded<RecordChecksumList> Decode(const uint8_t* data, int size);

// MAPMEND_FRAME_POSE. A pose that is not finite counts as not tracked.
template <>
std::vector<uint8_t> Encode(const FramePose& pose);
template <>
Decoded<FramePose> Decode(const uint8_t* data, int size);

// MAPMEND_GPS. Refused: what cannot be a position.
template <>
std::vector<uint8_t> Encode(const PositionFix& fix);
template <>
Decoded<PositionFix> Decode(const uint8_t* data, int size);

}  // namespace mapmend
