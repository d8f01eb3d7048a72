#include "libs/base/frame_ranges.h"

#include <charconv>
#include <sstream>
#include <stdexcept>

namespace mapmend {
namespace {

[[noreturn]] void Fail(const std::string& text) {
  throw std::runtime_error("--skip-frames " + text + ": expected ranges of frames, e.g. 80-120,200-240");
}

int ParseIndex(const std::string& text, const std::string& whole) {
  int value = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 0) Fail(whole);
  return value;
}

}  // namespace

std::set<int> ParseFrameRanges(const std::string& text) {
  if (text.ends_with(',')) Fail(text);
  std::set<int> frames;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    const size_t dash = part.find('-');
    const int first = ParseIndex(part.substr(0, dash), text);
    const int last = dash == std::string::npos ? first : ParseIndex(part.substr(dash + 1), text);
    if (last < first || last - first > 10000000) Fail(text);
    for (int i = first; i <= last; ++i) frames.insert(i);
  }
  return frames;
}

}  // namespace mapmend
