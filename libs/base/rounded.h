#pragma once

#include <string>

#include "libs/base/text_format.h"

namespace mapmend {

// A length or an area for a person: three figures, and no exponent however large it is.
inline std::string Rounded(double value) { return Format(value < 999.5 && value > -999.5 ? "%.3g" : "%.0f", value); }

}  // namespace mapmend
