#include "procs/frontend/image_options.h"

#include <charconv>
#include <stdexcept>

namespace mapmend {
namespace {

constexpr int kLiveWidth = 640, kLeastWidth = 16, kMostWidth = 65535;

// The width that a text names, or 0.
int ParseWidth(const std::string& text) {
  int width = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, width);
  return error == std::errc() && stop == end && width >= kLeastWidth && width <= kMostWidth ? width : 0;
}

}  // namespace

std::string ImageOptions::Conflict() const {
  if (keep.empty() || keep == "full" || keep == "none" || ParseWidth(keep) > 0) return "";
  return "images '" + keep + "': known are full, none, and a width of " + std::to_string(kLeastWidth) + " to " +
         std::to_string(kMostWidth) + " pixels";
}

int KeptWidth(const ImageOptions& options, bool is_live) {
  if (const std::string conflict = options.Conflict(); !conflict.empty()) throw std::runtime_error(conflict);
  if (options.keep.empty()) return is_live ? kLiveWidth : kFullSize;
  return options.keep == "full" ? kFullSize : options.keep == "none" ? kNoImages : ParseWidth(options.keep);
}

}  // namespace mapmend
