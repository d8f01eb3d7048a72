#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

// Arrays in the database are blobs of little-endian numbers without a header (words: see PackAscending); what they hold
// is fixed by their column.
namespace mapmend {

template <typename T>
void BindBlob(SQLite::Statement* statement, int index, const std::vector<T>& values) {
  // An empty vector is an empty blob, not NULL.
  static const char kEmpty = 0;
  statement->bindNoCopy(index, values.empty() ? static_cast<const void*>(&kEmpty) : values.data(),
                        static_cast<int>(values.size() * sizeof(T)));
}

template <typename T>
std::vector<T> ReadBlob(const SQLite::Column& column) {
  std::vector<T> values(static_cast<size_t>(column.getBytes()) / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), column.getBlob(), values.size() * sizeof(T));
  return values;
}

// Appends a number in LEB128: 7 bits a byte, low bits first, the top bit set on all but the last byte.
inline void PackNumber(uint32_t value, std::vector<uint8_t>* packed) {
  for (; value >= 0x80; value >>= 7) packed->push_back(static_cast<uint8_t>(value | 0x80));
  packed->push_back(static_cast<uint8_t>(value));
}

// Ascending numbers as differences: word ids take 1 to 2 bytes instead of 4.
inline std::vector<uint8_t> PackAscending(const std::vector<int32_t>& values) {
  std::vector<uint8_t> packed;
  int32_t previous = 0;
  for (const int32_t value : values) {
    PackNumber(static_cast<uint32_t>(value - previous), &packed);
    previous = value;
  }
  return packed;
}

// What each feature observes (-1: nothing), about half of them something: for each of those how many features come
// between the one before and it, then the difference of the map point's id from the one before, zigzag (0, -1, 1, -2,
// ...: 0, 1, 2, 3, ...).
inline std::vector<uint8_t> PackObservations(const std::vector<int32_t>& points) {
  std::vector<uint8_t> packed;
  uint32_t skipped = 0;
  int32_t previous = 0;
  for (const int32_t point : points) {
    if (point < 0) {
      ++skipped;
      continue;
    }
    const int32_t difference = point - previous;
    PackNumber(skipped, &packed);
    PackNumber(static_cast<uint32_t>(difference) << 1 ^ static_cast<uint32_t>(difference >> 31), &packed);
    skipped = 0;
    previous = point;
  }
  return packed;
}

inline std::vector<int32_t> UnpackAscending(const SQLite::Column& column) {
  std::vector<int32_t> values;
  const auto* bytes = static_cast<const uint8_t*>(column.getBlob());
  uint32_t value = 0, difference = 0;
  int shift = 0;
  for (int i = 0; i < column.getBytes(); ++i) {
    difference |= static_cast<uint32_t>(bytes[i] & 0x7f) << shift;
    shift = std::min(shift + 7, 28);
    if (bytes[i] & 0x80) continue;
    value += difference;
    values.push_back(static_cast<int32_t>(value));
    difference = 0;
    shift = 0;
  }
  return values;
}

}  // namespace mapmend
