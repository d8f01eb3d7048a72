#pragma once

#include <cstdio>
#include <string>

namespace mapmend {

// As printf.
template <typename... Args>
std::string Format(const char* format, Args... args) {
  std::string text(static_cast<size_t>(std::snprintf(nullptr, 0, format, args...)), '\0');
  std::snprintf(text.data(), text.size() + 1, format, args...);
  return text;
}

}  // namespace mapmend
