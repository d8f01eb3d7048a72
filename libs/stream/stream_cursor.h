#pragma once

#include <cstdint>
#include <string>

namespace mapmend {

// How much of a session's stream somebody has had.
struct StreamCursor {
  std::string session;
  int64_t seq = -1;  // of the last record; -1: none
  bool operator==(const StreamCursor&) const = default;
};

}  // namespace mapmend
