#pragma once

#include <numbers>

namespace mapmend {

constexpr double kDegree = std::numbers::pi / 180;  // in radians

}  // namespace mapmend
