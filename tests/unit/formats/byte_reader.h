#pragma once

#include <cstring>
#include <stdexcept>
#include <string>

namespace mapmend {

// Reads what Append has written; throws where there is nothing left.
class ByteReader {
 public:
  explicit ByteReader(std::string bytes, size_t at = 0) : bytes_(std::move(bytes)), at_(at) {}

  template <typename T>
  T Take() {
    T value;
    std::memcpy(&value, Bytes(sizeof(T)).data(), sizeof(T));
    return value;
  }
  std::string Bytes(size_t size) {
    if (at_ > bytes_.size() || size > bytes_.size() - at_) throw std::runtime_error("the bytes end early");
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }
  // As MCAP has it.
  std::string Text() { return Bytes(Take<uint32_t>()); }
  size_t At() const { return at_; }
  bool AtEnd() const { return at_ == bytes_.size(); }

 private:
  std::string bytes_;
  size_t at_;
};

}  // namespace mapmend
