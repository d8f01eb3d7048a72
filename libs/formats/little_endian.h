#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

namespace mapmend {

// Appends a number as its bytes lie in memory, lowest first.
template <typename T>
void Append(T value, std::string* bytes) {
  static_assert(std::is_arithmetic_v<T> && std::endian::native == std::endian::little);
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes->append(raw, sizeof(T));
}

// Appends a text in a field of fixed size, the rest of which is zero; what does not fit is cut off.
inline void AppendPadded(std::string_view text, size_t size, std::string* bytes) {
  bytes->append(text.substr(0, size));
  bytes->append(size - std::min(size, text.size()), '\0');
}

}  // namespace mapmend
