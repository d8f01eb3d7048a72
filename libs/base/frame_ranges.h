#pragma once

#include <set>
#include <string>

namespace mapmend {

// "80-120,200" is 80 to 120 and 200; an empty text is no frame. Throws std::runtime_error with one line that names
// --skip-frames for anything else.
std::set<int> ParseFrameRanges(const std::string& text);

}  // namespace mapmend
