#pragma once

// Quantiles of the chi-square distribution, against which squared errors are held that are measured in their own sigma:
// of the errors of right matches so many lie below.
namespace mapmend {

// Two degrees of freedom: a reprojection error, x and y of one image.
inline constexpr double kChiSquare2Dof95 = 5.991;
inline constexpr double kChiSquare2Dof99 = 9.21;
// The root of the first: the length of such an error, where a robust loss takes over.
inline constexpr double kChi2Dof95 = 2.4477;
// One degree of freedom, the root: the distance of a pixel from a line.
inline constexpr double kChi1Dof95 = 1.96;

}  // namespace mapmend
