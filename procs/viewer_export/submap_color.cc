#include "procs/viewer_export/submap_color.h"

#include <string>

#include "libs/drawing/canvas.h"

namespace mapmend {

std::array<uint8_t, 3> SubmapColor(int number) {
  const unsigned long rgb = std::stoul(CategoryColor(number).substr(1), nullptr, 16);
  return {static_cast<uint8_t>(rgb >> 16), static_cast<uint8_t>(rgb >> 8), static_cast<uint8_t>(rgb)};
}

}  // namespace mapmend
