#pragma once

#include <cstdint>
#include <string>

namespace mapmend {

// "1 frame", "2 frames".
inline std::string Plural(int64_t count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

}  // namespace mapmend
