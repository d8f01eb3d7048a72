#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

// What tells a flipped bit: CRC-32 as zlib, PNG and Python's zlib.crc32 have it.
namespace mapmend {

// Of the bytes that came before (`so_far`, 0 at first) and these.
uint32_t Crc32(const void* data, size_t size, uint32_t so_far = 0);

// Of a record: of its channel's name without prefix, a zero byte, and its payload. In the database and in recordings.
uint32_t RecordChecksum(const std::string& channel, const uint8_t* data, size_t size);

}  // namespace mapmend
