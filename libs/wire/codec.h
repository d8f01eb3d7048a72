#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libs/stream/records.h"

// Records of the stream to and from their wire form. Decoding treats the bytes as untrusted: lengths, counts that must
// agree, ids, octaves and finiteness are checked.
namespace mapmend {

EncodedRecord EncodeRecord(const Record& record);

struct DecodedRecord {
  std::optional<Record> record;
  std::string error;  // one line, if there is no record
};
// Never throws for bad bytes.
DecodedRecord DecodeRecord(const std::string& channel, const uint8_t* data, int size);
DecodedRecord DecodeRecord(const EncodedRecord& record);

// The header alone, which stands first in every record behind the type's hash. nullopt if it is not valid.
std::optional<RecordHeader> PeekHeader(const uint8_t* data, int size);

// Session names: 1 to 64 letters, digits, - or _ (UUIDs fit).
bool IsSessionId(const std::string& text);
// MAPMEND_SESSION, MAPMEND_SUBMAP, MAPMEND_KEYFRAME, MAPMEND_MAP_UPDATE, MAPMEND_WIDE_FEATURES and MAPMEND_POSITIONS.
bool IsRecordChannel(const std::string& channel);
inline constexpr const char* kRecordChannels[] = {"MAPMEND_SESSION",    "MAPMEND_SUBMAP",        "MAPMEND_KEYFRAME",
                                                  "MAPMEND_MAP_UPDATE", "MAPMEND_WIDE_FEATURES", "MAPMEND_POSITIONS"};

}  // namespace mapmend
