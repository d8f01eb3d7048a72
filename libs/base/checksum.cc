#include "libs/base/checksum.h"

#include <zlib.h>

namespace mapmend {

uint32_t Crc32(const void* data, size_t size, uint32_t so_far) {
  if (size == 0) return so_far;  // zlib takes a null pointer for the wish to begin anew
  return static_cast<uint32_t>(crc32_z(so_far, static_cast<const Bytef*>(data), size));
}

uint32_t RecordChecksum(const std::string& channel, const uint8_t* data, size_t size) {
  return Crc32(data, size, Crc32(channel.c_str(), channel.size() + 1));
}

}  // namespace mapmend
