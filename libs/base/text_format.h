#pragma once

#include <cstdio>
#include <string>

namespace mapmend {

// As printf, for one sentence with numbers: at most 319 characters.
template <typename... Args>
std::string Format(const char* format, Args... args) {
  char buffer[320];
  std::snprintf(buffer, sizeof(buffer), format, args...);
  return buffer;
}

}  // namespace mapmend
