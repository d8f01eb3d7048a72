#include "libs/bus/requests.h"

namespace mapmend {
namespace {

uint64_t GetBigEndian(const uint8_t* p, int num_bytes) {
  uint64_t value = 0;
  for (int i = 0; i < num_bytes; ++i) value = value << 8 | p[i];
  return value;
}

}  // namespace

std::optional<ReplyAddress> PeekReply(const uint8_t* data, int size) {
  constexpr int kFingerprint = 8, kId = 8, kLength = 4;
  const int text = kFingerprint + kId + kLength;
  if (size < text + 1) return std::nullopt;
  ReplyAddress address;
  address.id = static_cast<int64_t>(GetBigEndian(data + kFingerprint, kId));
  const uint64_t length = GetBigEndian(data + kFingerprint + kId, kLength);  // with the terminator
  if (length < 1 || length > static_cast<uint64_t>(size - text)) return std::nullopt;
  address.requester.assign(reinterpret_cast<const char*>(data + text), static_cast<size_t>(length - 1));
  return address;
}

}  // namespace mapmend
