#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <cstring>
#include <vector>

// Arrays in the database are blobs of little-endian numbers without a header; what they hold is fixed by their column.
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

}  // namespace mapmend
