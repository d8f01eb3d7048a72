#pragma once

#include <array>
#include <cstdint>

namespace mapmend {

// The colour that a submap has in all pictures, red, green, blue.
std::array<uint8_t, 3> SubmapColor(int number);

}  // namespace mapmend
