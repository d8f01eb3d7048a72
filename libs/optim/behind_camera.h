#pragma once

namespace mapmend {

// Points that are not in front of the camera have no projection: a constant residual and no derivative.
inline constexpr double kMinDepth = 1e-6;
inline constexpr double kResidualBehindCamera = 1e3;  // pixels

}  // namespace mapmend
