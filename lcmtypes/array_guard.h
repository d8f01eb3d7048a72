#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

// Called by the generated decoders before an array is allocated (guard_arrays.cmake puts the calls there): lcm-gen
// trusts the length that a message claims, so 4 forged bytes would allocate up to 2^31 elements.
namespace mapmend::lcm_guard {

// Bytes that one element takes at least on the wire.
template <typename T>
int64_t MinEncodedSize() {
  if constexpr (std::is_arithmetic_v<T>) {
    return sizeof(T);
  } else if constexpr (std::is_same_v<T, std::string>) {
    return 5;  // length and terminator
  } else {
    static const int64_t size = T{}._getEncodedSizeNoHash();  // empty strings and arrays
    return size;
  }
}

// Whether count elements can follow in the remaining bytes of the message.
template <typename T>
bool Fits(const std::vector<T>&, int64_t count, int64_t remaining) {
  return count >= 0 && remaining >= 0 && count <= remaining / MinEncodedSize<T>();
}

}  // namespace mapmend::lcm_guard
