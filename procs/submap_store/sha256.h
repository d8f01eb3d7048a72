#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace mapmend {

// SHA-256 (FIPS 180-4), fed piece by piece.
class Sha256 {
 public:
  void Add(const void* data, size_t size);
  void Add(const std::string& text);  // its length first, so that pieces cannot run into each other
  void Add(int64_t value);
  void Add(const std::vector<uint8_t>& bytes);  // as text
  // Lower-case hex. Ends the digest.
  std::string Hex();

 private:
  void Block(const uint8_t* block);

  std::array<uint32_t, 8> state_ = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                    0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<uint8_t, 64> buffer_{};
  size_t buffered_ = 0;
  uint64_t total_ = 0;
};

}  // namespace mapmend
