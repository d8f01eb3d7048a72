#pragma once

#include <cstdint>
#include <cstring>
#include <random>
#include <vector>

namespace mapmend {

// Damages a message as broken or hostile senders do: flipped bits, forged lengths, special floats, pieces cut out,
// inserted or repeated.
inline std::vector<uint8_t> MutateMessage(std::vector<uint8_t> data, std::mt19937* random) {
  const auto below = [&](size_t n) { return n == 0 ? 0 : (*random)() % n; };
  const auto put_u32 = [&](size_t at, uint32_t value) {
    for (size_t i = 0; i < 4 && at + i < data.size(); ++i) data[at + i] = static_cast<uint8_t>(value >> (24 - 8 * i));
  };
  static const uint32_t kSpecial[] = {0,          1,          2,          0xffffffff, 0x7fffffff,
                                      0x80000000, 0x10000000, 0x00010000, 0x7fc00000, 0x7f800000,
                                      0xff800000, 0x40000000, 0x3fffffff, 0x0000ffff};
  const size_t num_changes = 1 + below(3);
  for (size_t change = 0; change < num_changes; ++change) {
    // The first 8 bytes name the type; they are damaged seldom, or nothing else would be tested.
    const size_t first = data.size() > 8 && below(50) != 0 ? 8 : 0;
    const size_t at = first + below(data.size() - first);
    switch (below(6)) {
      case 0:
        if (!data.empty()) data[at] ^= static_cast<uint8_t>(1u << below(8));
        break;
      case 1:
        put_u32(at, kSpecial[below(std::size(kSpecial))]);
        break;
      case 2:
        put_u32(at, static_cast<uint32_t>(below(64)));
        break;
      case 3:
        data.insert(data.begin() + static_cast<std::ptrdiff_t>(std::min(at, data.size())), below(40),
                    static_cast<uint8_t>(below(3) == 0 ? below(256) : 0));
        break;
      case 4: {
        const size_t n = std::min(data.size() - std::min(at, data.size()), 1 + below(40));
        data.erase(data.begin() + static_cast<std::ptrdiff_t>(std::min(at, data.size())),
                   data.begin() + static_cast<std::ptrdiff_t>(std::min(at, data.size()) + n));
        break;
      }
      default:
        data.resize(below(data.size() + 1));
    }
    if (data.empty()) break;
  }
  return data;
}

}  // namespace mapmend
