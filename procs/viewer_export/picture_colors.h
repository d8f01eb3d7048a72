#pragma once

namespace mapmend {

// Of text and lines in pictures on white paper.
inline constexpr char kInk[] = "#1f2933", kMuted[] = "#6b7785", kRed[] = "#d6212b";

}  // namespace mapmend
